/* What the C test programs share: the fixture that write_fixture wrote, and the frames, options and
 * sessions of a host. Every program is called with the fixture's folder. */
#pragma once

#include <stdio.h>
#include <string.h>

#include <plumbline/plumbline.h>

#define NUM_FRAMES 4
#define SECOND_NS INT64_C(1000000000)

extern int num_failures;

#define EXPECT(condition)                                                             \
  do {                                                                                \
    if (!(condition)) {                                                               \
      ++num_failures;                                                                 \
      fprintf(stderr, "%s:%d: %s (last error: %s)\n", __FILE__, __LINE__, #condition, \
              plumb_last_error());                                                    \
    }                                                                                 \
  } while (0)

/* An error whose text names what was wrong. */
#define EXPECT_ERROR(call, code, part)                  \
  do {                                                  \
    EXPECT((call) == (code));                           \
    EXPECT(strstr(plumb_last_error(), (part)) != NULL); \
  } while (0)

typedef struct fixture {
  char map_path[1024];
  uint8_t* pixels[NUM_FRAMES];
  uint8_t* through_radtan; /* frame 0 through lenses */
  uint8_t* through_fisheye;
  uint32_t width_px, height_px;
  double camera[4];
  double prior_q[NUM_FRAMES][4], prior_t[NUM_FRAMES][3];
  double true_q[NUM_FRAMES][4], true_t[NUM_FRAMES][3];
} fixture;

plumb_frame make_frame(const fixture* f, int i);
plumb_session_options make_options(const plumb_map* map);
plumb_session* make_session(const plumb_session_options* options);
plumb_frame_result empty_result(void);

/* Refines one frame in a session of its own; returns its result. */
plumb_frame_result refine_frame(const plumb_session_options* options, const plumb_frame* frame);

/* Of the translation of cam_from_world, which moves with both kinds of error. */
double translation_error(const fixture* f, int i, const double t[3]);

/* Reads the fixture that the arguments name, opens its map and calls `tests`.
 * Returns the program's exit status. */
int run_tests(int argc, char** argv, void (*tests)(const fixture* f, const plumb_map* map));
