// Options of the commands, read by tables: those of a command of its own, and those of the settings' table.
#include "lanternfield.h"

#include <string.h>
#include <strings.h>

bool option_refuse(setting_error *error, const char *option, const char *expected, const char *value)
{
    snprintf(error->message, sizeof(error->message), "%s: expected %s, got \"%.80s\"", option, expected, value);
    return false;
}

bool path_has_extension(const char *path, const char *extension)
{
    const size_t length = strlen(path), extension_length = strlen(extension);
    return length > extension_length && strcasecmp(path + length - extension_length, extension) == 0;
}

static const command_option *command_option_find(const command_syntax *syntax, const char *name)
{
    for (size_t g = 0; g < OPTION_GROUPS_MAX; g++) {
        for (size_t i = 0; i < syntax->groups[g].count; i++) {
            if (strcmp(syntax->groups[g].options[i].name, name) == 0) {
                return &syntax->groups[g].options[i];
            }
        }
    }
    return NULL;
}

// ---- Help, made from the tables

static void help_line_print(FILE *out, const char *name, const char *value_name, const char *text)
{
    char left[64];
    snprintf(left, sizeof(left), "%s%s %s", name[1] ? "--" : "-", name, value_name);
    // What is too wide for the left column gets a line of its own.
    fprintf(out, strlen(left) <= 26 ? "  %-26s %s\n" : "  %s\n                             %s\n", left, text);
}

// "a|b|c"
static void alternatives_print(const char *const *names, char *text, size_t size)
{
    size_t length = 0;
    for (uint32_t i = 0; names[i]; i++) {
        length += (size_t)snprintf(text + length, size - length, "%s%s", i ? "|" : "", names[i]);
        assert(length < size);
    }
}

static bool setting_is_switch(const setting_info *info)
{
    return info->type == SETTING_TRUE || info->type == SETTING_FALSE;
}

static void setting_help_print(FILE *out, const setting_info *info)
{
    char value_name[64] = "", default_text[32], text[160];
    if (info->value_name) {
        snprintf(value_name, sizeof(value_name), "%s", info->value_name);
    } else if (info->type == SETTING_ENUM) {
        alternatives_print(info->values, value_name, sizeof(value_name));
    }
    const render_settings defaults = render_settings_default();
    settings_get(&defaults, info, default_text);
    const char *const shown = setting_is_switch(info) ? "off" : default_text;
    snprintf(text, sizeof(text), "%s (default %s)", info->help, shown);
    help_line_print(out, info->name, value_name, text);
}

static const char *setting_refusal(const command_syntax *syntax, const setting_info *info)
{
    return info && syntax->setting_refusal ? syntax->setting_refusal(info) : NULL;
}

void options_help_print(FILE *out, const command_syntax *syntax)
{
    for (size_t g = 0; g < OPTION_GROUPS_MAX && syntax->groups[g].count > 0; g++) {
        const option_group *const group = &syntax->groups[g];
        fprintf(out, "\n%s\n", group->title);
        for (size_t i = 0; i < group->count; i++) {
            const command_option *const option = &group->options[i];
            help_line_print(out, option->name, option->value_name ? option->value_name : "", option->help);
        }
    }
    fputs("\nRendering\n", out);
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        if (!setting_refusal(syntax, &table[i])) {
            setting_help_print(out, &table[i]);
        }
    }
}

// ---- Reading the command line

// An option as it was written: "--name=value", "--name value", "-n value" or "--name".
typedef struct option_word {
    char name[32]; // without dashes
    const char *written; // the whole word
    const char *own_value; // behind '='; NULL: none
} option_word;

static option_word option_word_split(const char *word)
{
    const bool is_long = word[1] == '-';
    const char *const name = word + (is_long ? 2 : 1);
    const char *const equals = is_long ? strchr(name, '=') : NULL;
    const size_t length = equals ? (size_t)(equals - name) : strlen(name);
    option_word split = {.written = word, .own_value = equals ? equals + 1 : NULL};
    // A name of the wrong length for its dashes, or longer than any, finds nothing.
    if (is_long == (length > 1) && length < sizeof(split.name)) {
        memcpy(split.name, name, length);
    }
    return split;
}

// Reads the option at argv[*i] and moves on to its value when it has one of its own.
static int option_read(const command_syntax *syntax, int argc, char **argv, int *i, render_request *request)
{
    char usage_hint[64];
    snprintf(usage_hint, sizeof(usage_hint), "; see lanternfield %s --help", syntax->command);
    const option_word word = option_word_split(argv[*i]);
    const setting_info *const setting = settings_find(word.name);
    const command_option *const option = command_option_find(syntax, word.name);
    if (!setting && !option) {
        log_error("unknown option %s%s", word.written, usage_hint);
        return EXIT_WRONG_USAGE;
    }
    const char *const refusal = setting_refusal(syntax, setting);
    if (refusal) {
        log_error("--%s: cannot be used to %s: %s", word.name, syntax->command, refusal);
        return EXIT_FAILED;
    }

    const bool takes_value = setting ? !setting_is_switch(setting) : option->value_name != NULL;
    const char *value = word.own_value;
    if (takes_value && !value) {
        if (*i + 1 == argc) {
            log_error("%s: its value is missing%s", word.written, usage_hint);
            return EXIT_WRONG_USAGE;
        }
        value = argv[++*i];
    }
    if (!setting && !takes_value && value) {
        log_error("%s: it takes no value%s", word.written, usage_hint);
        return EXIT_WRONG_USAGE;
    }

    setting_error error = {0};
    if (setting ? syntax->setting_read(request, setting, value, &error) : option->read(request, value, &error)) {
        return EXIT_DONE;
    }
    log_error("%s%s", error.message, error.out_of_range ? "" : usage_hint);
    return error.out_of_range ? EXIT_FAILED : EXIT_WRONG_USAGE;
}

int command_line_read(const command_syntax *syntax, int argc, char **argv, render_request *request)
{
    for (int i = 0; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            request->help = true;
            return EXIT_DONE;
        }
        if (argv[i][0] != '-') {
            if (!syntax->word_read(request, argv[i])) {
                return EXIT_WRONG_USAGE;
            }
            continue;
        }
        const int code = option_read(syntax, argc, argv, &i, request);
        if (code != EXIT_DONE) {
            return code;
        }
    }
    return EXIT_DONE;
}
