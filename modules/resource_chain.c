// Resources that several passes make in turn: see resource_chain.h.
#include "resource_chain.h"

#include <stdio.h>

typedef struct version_name {
    char text[64];
} version_name;

// What the `made`-th pass makes, from 1.
static version_name version(const resource_chain *chain, uint32_t made)
{
    version_name name;
    const int length = made == chain->length ? snprintf(name.text, sizeof name.text, "%s", chain->name)
                                             : snprintf(name.text, sizeof name.text, "%s_%u", chain->name, made);
    assert((size_t)length < sizeof name.text);
    (void)length;
    return name;
}

static void next(resource_chain *chain, frame_graph_pass *pass, frame_graph_access access)
{
    assert(chain->done < chain->length);
    const version_name from = version(chain, chain->done), to = version(chain, chain->done + 1);
    if (chain->done == 0)
        frame_graph_create_resource(pass, to.text, &chain->desc, access);
    else
        frame_graph_modify(pass, from.text, to.text, access);
    chain->done++;
}

void resource_chain_next(resource_chain *chain, frame_graph_pass *pass)
{
    next(chain, pass, ACCESS_STORAGE_READ_WRITE);
}

static void clear_execute(const frame_graph_context *context, void *user)
{
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, version(user, 1).text), 0, 16, 0);
}

resource_chain resource_chain_counter(frame_graph *graph, const char *clear, const char *name, uint32_t adders)
{
    resource_chain chain = {
        .name = name,
        .desc = {.kind = FRAME_GRAPH_BUFFER, .size = 16, .host = true},
        .length = adders + 1,
    };
    const frame_graph_pass_desc desc = {
        .name = clear,
        .kind = FRAME_GRAPH_TRANSFER,
        .execute = clear_execute,
        .user = &chain,
        .user_size = sizeof chain,
    };
    next(&chain, frame_graph_pass_add(graph, &desc), ACCESS_TRANSFER_WRITE);
    return chain;
}
