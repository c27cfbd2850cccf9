// A few macros over CTest. A test reads like the claim it checks:
//
//     TEST(pass_nobody_reads_is_culled) { ...; CHECK(plan->culled_count == 1); }
//     int main(void) { RUN(pass_nobody_reads_is_culled); return test_end(); }
#pragma once

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int test_failures, test_count;

#define TEST(name) static void test_##name(void)
#define RUN(name) (test_count++, printf("%s\n", #name), fflush(stdout), test_##name())

// Failed checks are counted and the test goes on.
#define CHECK(condition)                                                                                               \
    ((condition) ? (void)0 : (void)(test_failures++, printf("%s:%d: failed: %s\n", __FILE__, __LINE__, #condition)))
#define CHECK_NEAR(actual, expected, tolerance)                                                                        \
    test_check_near(__FILE__, __LINE__, #actual, (actual), (expected), (tolerance))
#define CHECK_STRING(actual, expected) test_check_string(__FILE__, __LINE__, (actual), (expected))

static inline void test_check_near(const char *file, int line, const char *what, double actual, double expected,
                                   double tolerance)
{
    if (!(fabs(actual - expected) <= tolerance)) {
        test_failures++;
        printf("%s:%d: failed: %s is %.9g, expected %.9g within %.3g\n", file, line, what, actual, expected, tolerance);
    }
}

static inline void test_check_string(const char *file, int line, const char *actual, const char *expected)
{
    if (!actual || strcmp(actual, expected) != 0) {
        test_failures++;
        printf("%s:%d: failed: \"%s\", expected \"%s\"\n", file, line, actual ? actual : "(null)", expected);
    }
}

// Prints the closing line; the exit code of main.
static inline int test_end(void)
{
    printf("%d tests, %d failed checks\n", test_count, test_failures);
    return test_failures ? EXIT_FAILURE : EXIT_SUCCESS;
}
