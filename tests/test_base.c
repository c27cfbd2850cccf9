// The log, arenas and whole-file input and output.
#include "engine/base.h"
#include "test.h"

#include <dirent.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

// ---- What the log received since log_capture_begin.

static struct {
    log_level level;
    char line[4096];
    int count;
} captured;

static void capture_sink(log_level level, const char *line, void *user)
{
    (void)user;
    captured.level = level;
    captured.count++;
    snprintf(captured.line, sizeof(captured.line), "%s", line);
}

static void log_capture_begin(void)
{
    memset(&captured, 0, sizeof(captured));
    log_sink_set(capture_sink, NULL);
}

static bool one_error_names(const char *text)
{
    return captured.count == 1 && captured.level == LOG_ERROR && strstr(captured.line, text);
}

// ---- A folder for the files of one test.

static char folder[64];

static void folder_begin(void)
{
    strcpy(folder, "/tmp/lanternfield_test_base_XXXXXX");
    if (!mkdtemp(folder)) {
        perror(folder);
        exit(EXIT_FAILURE);
    }
}

// A static buffer, good until the next call.
static const char *in_folder(const char *name)
{
    static char path[128];
    snprintf(path, sizeof(path), "%s/%s", folder, name);
    return path;
}

static int folder_file_count(void)
{
    DIR *const directory = opendir(folder);
    int count = 0;
    for (const struct dirent *entry; (entry = readdir(directory));) {
        count += strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0;
    }
    closedir(directory);
    return count;
}

static void folder_end(void)
{
    DIR *const directory = opendir(folder);
    for (const struct dirent *entry; (entry = readdir(directory));) {
        unlinkat(dirfd(directory), entry->d_name, 0);
    }
    closedir(directory);
    CHECK(rmdir(folder) == 0);
}

static bool file_holds(const char *path, const char *text)
{
    size_t size = 0;
    uint8_t *const bytes = file_read(path, &size);
    const bool same = bytes && size == strlen(text) && memcmp(bytes, text, size) == 0;
    free(bytes);
    return same;
}

// Writes as if the disk had room for `limit` bytes.
static bool file_write_on_full_disk(const char *path, const void *bytes, size_t size, rlim_t limit)
{
    struct rlimit before;
    getrlimit(RLIMIT_FSIZE, &before);
    void (*const handler)(int) = signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &(struct rlimit){.rlim_cur = limit, .rlim_max = before.rlim_max});
    const bool ok = file_write(path, bytes, size);
    setrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, handler);
    return ok;
}

// ---- Helpers

TEST(helpers_round_up)
{
    CHECK(div_up_u32(0, 8) == 0 && div_up_u32(1, 8) == 1 && div_up_u32(8, 8) == 1 && div_up_u32(9, 8) == 2);
    CHECK(align_up(0, 16) == 0 && align_up(1, 16) == 16 && align_up(16, 16) == 16 && align_up(17, 16) == 32);
    CHECK(align_up((uint64_t)1 << 40 | 1, 256) == ((uint64_t)1 << 40 | 256));
    CHECK(min_u32(2, 3) == 2 && max_u32(2, 3) == 3);
}

// ---- Log

TEST(log_sink_receives_the_level_and_the_formatted_line)
{
    log_capture_begin();
    log_warning("light %d of \"%s\"", 7, "atrium");
    CHECK(captured.count == 1 && captured.level == LOG_WARNING);
    CHECK_STRING(captured.line, "light 7 of \"atrium\"");
    log_debug("seen");
    CHECK(captured.count == 2 && captured.level == LOG_DEBUG);
    log_sink_set(NULL, NULL);
}

static void count_sink(log_level level, const char *line, void *user)
{
    (void)level;
    (void)line;
    ++*(int *)user;
}

TEST(log_sink_receives_its_user_pointer)
{
    int count = 0;
    log_sink_set(count_sink, &count);
    log_info("one");
    log_info("two");
    log_sink_set(NULL, NULL);
    CHECK(count == 2);
}

TEST(log_lines_of_any_length_arrive_whole)
{
    for (int length = 510; length <= 514; length++) {
        log_capture_begin();
        log_info("%0*d", length, 1);
        CHECK(strlen(captured.line) == (size_t)length && captured.line[length - 1] == '1');
    }
    log_info("%03000d", 1);
    CHECK(strlen(captured.line) == 3000 && captured.line[2999] == '1');
    log_sink_set(NULL, NULL);
}

TEST(default_sink_prefixes_by_level_on_stderr_and_drops_debug)
{
    FILE *const file = tmpfile();
    fflush(stderr);
    const int saved = dup(STDERR_FILENO);
    dup2(fileno(file), STDERR_FILENO);
    log_sink_set(NULL, NULL);
    log_debug("unseen");
    log_info("plain");
    log_warning("odd");
    log_error("bad");
    fflush(stderr);
    dup2(saved, STDERR_FILENO);
    close(saved);

    char text[256] = {0};
    rewind(file);
    fread(text, 1, sizeof(text) - 1, file);
    fclose(file);
    CHECK_STRING(text, "plain\nlanternfield: warning: odd\nlanternfield: error: bad\n");
}

// ---- Memory

TEST(memory_alloc_is_zeroed_and_never_null)
{
    unsigned char *const bytes = memory_alloc(1000);
    for (int i = 0; i < 1000; i++) {
        CHECK(bytes[i] == 0);
    }
    free(bytes);
    void *const nothing = memory_alloc(0);
    CHECK(nothing);
    free(nothing);
}

TEST(memory_reserve_keeps_items_and_zeroes_new_space)
{
    uint32_t *items = NULL;
    size_t capacity = 0;
    for (uint32_t count = 1; count <= 1000; count++) {
        memory_reserve((void **)&items, &capacity, count, sizeof(*items));
        CHECK(capacity >= count && items[count - 1] == 0);
        items[count - 1] = count;
    }
    for (uint32_t i = 0; i < 1000; i++) {
        CHECK(items[i] == i + 1);
    }
    for (size_t i = 1000; i < capacity; i++) {
        CHECK(items[i] == 0);
    }
    free(items);
}

TEST(memory_reserve_grows_rarely)
{
    char *items = NULL;
    size_t capacity = 0;
    int growths = 0;
    for (size_t count = 1; count <= 100000; count++) {
        const size_t before = capacity;
        memory_reserve((void **)&items, &capacity, count, 1);
        growths += capacity != before;
    }
    CHECK(growths <= 20);
    memory_reserve((void **)&items, &capacity, 10, 1);
    CHECK(capacity >= 100000);
    free(items);
}

// ---- Arena

TEST(arena_allocations_are_aligned_zeroed_and_disjoint)
{
    arena arena = {0};
    unsigned char *pointers[200];
    for (size_t i = 0; i < countof(pointers); i++) {
        const size_t size = i * 7;
        pointers[i] = arena_alloc(&arena, size);
        CHECK((uintptr_t)pointers[i] % 16 == 0);
        for (size_t j = 0; j < size; j++) {
            CHECK(pointers[i][j] == 0);
        }
        memset(pointers[i], (int)i, size);
    }
    for (size_t i = 0; i < countof(pointers); i++) {
        for (size_t j = 0; j < i * 7; j++) {
            CHECK(pointers[i][j] == (unsigned char)i);
        }
    }
    arena_fini(&arena);
}

TEST(arena_holds_allocations_larger_than_its_blocks)
{
    arena arena = {0};
    char *const small = arena_strdup(&arena, "small");
    const size_t size = 5 << 20;
    unsigned char *const large = arena_alloc(&arena, size);
    large[0] = large[size - 1] = 1;
    CHECK_STRING(small, "small");
    CHECK_STRING(arena_strdup(&arena, "after"), "after");
    CHECK(large[size - 1] == 1);
    arena_fini(&arena);
}

TEST(arena_reset_reuses_memory_and_zeroes_it_again)
{
    arena arena = {0};
    unsigned char *const first = arena_alloc(&arena, 100);
    memset(first, 0xff, 100);
    arena_reset(&arena);
    const unsigned char *const second = arena_alloc(&arena, 100);
    CHECK(second == first);
    for (int i = 0; i < 100; i++) {
        CHECK(second[i] == 0);
    }
    arena_fini(&arena);
}

TEST(arena_stops_allocating_blocks_once_warm)
{
    arena arena = {0};
    const struct arena_block *warm = NULL;
    for (int frame = 0; frame < 10; frame++) {
        for (int i = 0; i < 1000; i++) {
            arena_alloc(&arena, 1000);
        }
        if (frame == 2) {
            warm = arena.block;
        }
        CHECK(frame <= 2 || arena.block == warm);
        arena_reset(&arena);
    }
    arena_fini(&arena);
}

TEST(arena_works_again_after_fini_and_resets_while_empty)
{
    arena arena = {0};
    arena_reset(&arena);
    arena_alloc(&arena, 10);
    arena_fini(&arena);
    arena_reset(&arena);
    CHECK_STRING(arena_strdup(&arena, "again"), "again");
    arena_fini(&arena);
    arena_fini(&arena);
}

TEST(arena_printf_formats_text_of_any_length)
{
    arena arena = {0};
    CHECK_STRING(arena_printf(&arena, "pass %s, %u draws", "gbuffer", 3u), "pass gbuffer, 3 draws");
    CHECK_STRING(arena_printf(&arena, "%s", ""), "");
    const char *const text = arena_printf(&arena, "%0100000d", 5);
    CHECK(strlen(text) == 100000 && text[99999] == '5');
    arena_fini(&arena);
}

// ---- Files

TEST(file_read_returns_what_file_write_wrote_with_a_zero_after_it)
{
    folder_begin();
    unsigned char bytes[100000];
    for (size_t i = 0; i < sizeof(bytes); i++) {
        bytes[i] = (unsigned char)(i * 31 + i / 256);
    }
    CHECK(file_write(in_folder("bytes"), bytes, sizeof(bytes)));
    size_t size = 0;
    uint8_t *const read = file_read(in_folder("bytes"), &size);
    CHECK(read && size == sizeof(bytes) && memcmp(read, bytes, size) == 0 && read[size] == 0);
    free(read);
    CHECK(folder_file_count() == 1);
    folder_end();
}

TEST(file_read_of_an_empty_file_returns_no_bytes_but_not_null)
{
    folder_begin();
    CHECK(file_write(in_folder("empty"), NULL, 0));
    size_t size = 1;
    uint8_t *const bytes = file_read(in_folder("empty"), &size);
    CHECK(bytes && size == 0 && bytes[0] == 0);
    free(bytes);
    folder_end();
}

TEST(file_read_of_a_missing_file_fails_and_names_it)
{
    log_capture_begin();
    size_t size;
    CHECK(!file_read("/tmp/no such file.glb", &size));
    CHECK(one_error_names("\"/tmp/no such file.glb\""));
    log_sink_set(NULL, NULL);
}

TEST(file_read_of_a_directory_fails_and_names_it)
{
    log_capture_begin();
    size_t size;
    CHECK(!file_read("/tmp", &size));
    CHECK(one_error_names("\"/tmp\""));
    log_sink_set(NULL, NULL);
}

TEST(file_read_of_a_pipe_fails_at_once)
{
    folder_begin();
    log_capture_begin();
    CHECK(mkfifo(in_folder("pipe"), 0600) == 0);
    size_t size;
    CHECK(!file_read(in_folder("pipe"), &size));
    CHECK(one_error_names("not a regular file"));
    log_sink_set(NULL, NULL);
    folder_end();
}

TEST(file_write_replaces_an_existing_file)
{
    folder_begin();
    CHECK(file_write(in_folder("file"), "a longer first text", 19));
    CHECK(file_write(in_folder("file"), "second", 6));
    CHECK(file_holds(in_folder("file"), "second"));
    CHECK(folder_file_count() == 1);
    folder_end();
}

TEST(file_write_obeys_the_umask)
{
    folder_begin();
    const mode_t before = umask(027);
    CHECK(file_write(in_folder("file"), "x", 1));
    umask(before);
    struct stat status = {0};
    CHECK(stat(in_folder("file"), &status) == 0 && (status.st_mode & 0777) == 0640);
    folder_end();
}

TEST(file_write_takes_a_name_without_a_folder)
{
    folder_begin();
    char before[4096];
    CHECK(getcwd(before, sizeof(before)) && chdir(folder) == 0);
    CHECK(file_write("here", "x", 1));
    CHECK(file_holds("here", "x"));
    CHECK(chdir(before) == 0);
    CHECK(folder_file_count() == 1);
    folder_end();
}

// A temporary file elsewhere could be on another file system, where renaming fails.
TEST(file_write_needs_no_other_folder_than_that_of_the_path)
{
    folder_begin();
    char before[4096];
    CHECK(getcwd(before, sizeof(before)) && chdir("/proc") == 0);
    CHECK(file_write(in_folder("file"), "x", 1));
    CHECK(chdir(before) == 0);
    folder_end();
}

TEST(file_write_into_a_missing_folder_fails_and_leaves_nothing)
{
    folder_begin();
    log_capture_begin();
    CHECK(!file_write(in_folder("missing/file"), "x", 1));
    CHECK(one_error_names("missing/file"));
    CHECK(folder_file_count() == 0);
    log_sink_set(NULL, NULL);
    folder_end();
}

TEST(file_write_on_a_full_disk_fails_and_leaves_nothing)
{
    folder_begin();
    log_capture_begin();
    static const char bytes[100000];
    CHECK(!file_write_on_full_disk(in_folder("file"), bytes, sizeof(bytes), 5000));
    CHECK(one_error_names("/file\": "));
    CHECK(folder_file_count() == 0);
    log_sink_set(NULL, NULL);
    folder_end();
}

TEST(file_write_on_a_full_disk_leaves_an_existing_file_untouched)
{
    folder_begin();
    CHECK(file_write(in_folder("file"), "precious", 8));
    log_capture_begin();
    static const char bytes[100000];
    CHECK(!file_write_on_full_disk(in_folder("file"), bytes, sizeof(bytes), 5000));
    log_sink_set(NULL, NULL);
    CHECK(file_holds(in_folder("file"), "precious"));
    CHECK(folder_file_count() == 1);
    folder_end();
}

TEST(file_write_refuses_to_replace_a_pipe_or_a_directory)
{
    folder_begin();
    CHECK(mkfifo(in_folder("pipe"), 0600) == 0);
    log_capture_begin();
    CHECK(!file_write(in_folder("pipe"), "x", 1));
    CHECK(one_error_names("/pipe\""));
    log_capture_begin();
    CHECK(!file_write(folder, "x", 1));
    CHECK(one_error_names(folder));
    log_sink_set(NULL, NULL);
    struct stat status = {0};
    CHECK(stat(in_folder("pipe"), &status) == 0 && S_ISFIFO(status.st_mode));
    CHECK(folder_file_count() == 1);
    folder_end();
}

TEST(time_goes_forward_in_seconds)
{
    const double before = time_now();
    usleep(2000);
    const double after = time_now();
    CHECK(after - before >= 0.002 && after - before < 60.0);
}

int main(void)
{
    RUN(helpers_round_up);
    RUN(log_sink_receives_the_level_and_the_formatted_line);
    RUN(log_sink_receives_its_user_pointer);
    RUN(log_lines_of_any_length_arrive_whole);
    RUN(default_sink_prefixes_by_level_on_stderr_and_drops_debug);
    RUN(memory_alloc_is_zeroed_and_never_null);
    RUN(memory_reserve_keeps_items_and_zeroes_new_space);
    RUN(memory_reserve_grows_rarely);
    RUN(arena_allocations_are_aligned_zeroed_and_disjoint);
    RUN(arena_holds_allocations_larger_than_its_blocks);
    RUN(arena_reset_reuses_memory_and_zeroes_it_again);
    RUN(arena_stops_allocating_blocks_once_warm);
    RUN(arena_works_again_after_fini_and_resets_while_empty);
    RUN(arena_printf_formats_text_of_any_length);
    RUN(file_read_returns_what_file_write_wrote_with_a_zero_after_it);
    RUN(file_read_of_an_empty_file_returns_no_bytes_but_not_null);
    RUN(file_read_of_a_missing_file_fails_and_names_it);
    RUN(file_read_of_a_directory_fails_and_names_it);
    RUN(file_read_of_a_pipe_fails_at_once);
    RUN(file_write_replaces_an_existing_file);
    RUN(file_write_obeys_the_umask);
    RUN(file_write_takes_a_name_without_a_folder);
    RUN(file_write_needs_no_other_folder_than_that_of_the_path);
    RUN(file_write_into_a_missing_folder_fails_and_leaves_nothing);
    RUN(file_write_on_a_full_disk_fails_and_leaves_nothing);
    RUN(file_write_on_a_full_disk_leaves_an_existing_file_untouched);
    RUN(file_write_refuses_to_replace_a_pipe_or_a_directory);
    RUN(time_goes_forward_in_seconds);
    return test_end();
}
