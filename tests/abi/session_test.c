/* A host program in C99 that uses sessions as meant. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#include "host.h"

static void test_frames_in_order(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_session_stats stats;
  int i, k;
  EXPECT(plumb_session_poll_result(session, &result) == PLUMB_NOT_READY);
  EXPECT(plumb_session_wait_result(session, 1000, &result) == PLUMB_TIMEOUT);
  for (i = 0; i < NUM_FRAMES; ++i) {
    plumb_frame frame = make_frame(f, i);
    EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  }
  for (i = 0; i < NUM_FRAMES; ++i) {
    EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
    EXPECT(result.struct_size == sizeof result);
    EXPECT(result.outcome == PLUMB_OUTCOME_PROCESSED);
    EXPECT(result.status == PLUMB_STATUS_REFINED);
    EXPECT(result.error == PLUMB_OK && result.error_message[0] == '\0');
    EXPECT(result.frame_index == (uint64_t)i);
    EXPECT(result.user_tag == 70u + (unsigned)i);
    EXPECT(result.timestamp_ns == 1000 + i);
    EXPECT(result.pose_convention == PLUMB_POSE_CV_CAM_FROM_WORLD);
    EXPECT(result.was_searched == 1);
    EXPECT(translation_error(f, i, f->prior_t[i]) > 0.03);
    EXPECT(translation_error(f, i, result.t_m) < 0.01);
    EXPECT(result.map_support > 0.3 && result.map_support <= 1.0);
    EXPECT(result.num_observed_directions == 6);
    EXPECT(result.num_segments > 20 && result.num_matches > 10);
    EXPECT(result.detect_ns > 0 && result.ridge_ns > 0 && result.refine_ns > 0);
    EXPECT(result.total_ns >= result.wait_ns + result.detect_ns + result.ridge_ns);
    for (k = 0; k < 6; ++k) {
      const double sigma = sqrt(result.covariance[7 * k]);
      EXPECT(sigma > 0.0 && sigma < 0.02);
    }
  }
  memset(&stats, 0, sizeof stats);
  stats.struct_size = sizeof stats;
  EXPECT(plumb_session_get_stats(session, &stats) == PLUMB_OK);
  EXPECT(stats.num_submitted == NUM_FRAMES && stats.num_processed == NUM_FRAMES);
  EXPECT(stats.num_dropped == 0 && stats.num_failed == 0 && stats.num_results_discarded == 0);
  plumb_session_destroy(session);
}

/* Each detection option changes what is found; a caller from before they were there has none. */
static void test_detection_options(const fixture* f, const plumb_map* map) {
  const plumb_frame frame = make_frame(f, 0);
  const plumb_session_options plain = make_options(map);
  plumb_session_options options;
  const uint32_t usual = refine_frame(&plain, &frame).num_segments;
  EXPECT(usual > 40);
#define EXPECT_SEGMENTS(change, relation)                         \
  do {                                                            \
    options = plain;                                              \
    change;                                                       \
    EXPECT(refine_frame(&options, &frame).num_segments relation); \
  } while (0)
  EXPECT_SEGMENTS(options.score_threshold = 0.5, < usual);
  EXPECT_SEGMENTS(options.min_length_px = 30.0, < usual);
  EXPECT_SEGMENTS(options.structural_nms = 2000.0, < usual);
  EXPECT_SEGMENTS(options.top_k = 10, <= 20); /* each may bring its other border */
  EXPECT_SEGMENTS(options.top_k = 10; options.edge_flags = PLUMB_EDGE_ONE_BORDER, <= 10);
  EXPECT_SEGMENTS(options.tile_columns = 2; options.tile_rows = 2, != 0);
  EXPECT_SEGMENTS(options.tile_columns = options.tile_rows = PLUMB_TILES_AUTO, == usual);
  EXPECT_SEGMENTS(options.edge_min_length_px = 30.0, < usual);
  EXPECT_SEGMENTS(options.edge_flags = PLUMB_EDGE_KEEP_DUPLICATES, >= usual); /* LSD has none */
  EXPECT_SEGMENTS(options.edge_flags = PLUMB_EDGE_KEEP_ENDS, != 0);
  EXPECT_SEGMENTS(options.struct_size = (uint32_t)offsetof(plumb_session_options, score_threshold);
                  options.top_k = 1, == usual);
#undef EXPECT_SEGMENTS
}

/* Whatever the settings: results come, in order, and a black image returns the prior. */
static void test_every_mode_and_method(const fixture* f, const plumb_map* map) {
  int combination;
  uint8_t* black = calloc((size_t)f->width_px, f->height_px);
  if (black == NULL) return;
  for (combination = 0; combination < 4; ++combination) {
    plumb_session_options options = make_options(map);
    plumb_session* session;
    int i, k;
    options.mode = combination % 2 == 0 ? PLUMB_MODE_INDEPENDENT : PLUMB_MODE_STREAM;
    options.method = combination < 2 ? PLUMB_METHOD_SEARCH : PLUMB_METHOD_PAPER;
    session = make_session(&options);
    for (i = 0; i < NUM_FRAMES; ++i) {
      plumb_frame_result result = empty_result();
      plumb_frame frame = make_frame(f, i);
      if (i == NUM_FRAMES - 1) frame.planes[0] = black;
      EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
      EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
      EXPECT(result.outcome == PLUMB_OUTCOME_PROCESSED);
      EXPECT(result.status != PLUMB_STATUS_NONE);
      EXPECT(result.frame_index == (uint64_t)i);
      for (k = 0; k < 3; ++k) EXPECT(isfinite(result.t_m[k]));
      if (i < NUM_FRAMES - 1) continue;
      EXPECT(result.status == PLUMB_STATUS_LOW_SUPPORT);
      EXPECT(result.num_segments == 0 && result.num_matches == 0);
      if (options.mode == PLUMB_MODE_INDEPENDENT) {
        for (k = 0; k < 3; ++k) EXPECT(fabs(result.t_m[k] - frame.prior_t_m[k]) < 1e-12);
      } else if (options.method == PLUMB_METHOD_SEARCH) { /* the correction is carried on */
        EXPECT(translation_error(f, i, result.t_m) < 0.02);
      }
    }
    plumb_session_destroy(session);
  }
  free(black);
}

static void count_result(const plumb_frame_result* result, void* user) {
  int* count = user;
  if (result->struct_size == sizeof *result && result->outcome == PLUMB_OUTCOME_PROCESSED) {
    ++*count;
  }
}

static void count_release(void* user) { ++*(int*)user; }

static void test_callbacks(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session;
  plumb_session_stats stats;
  int num_results = 0, num_released = 0, i;
  options.on_result = count_result;
  options.on_result_user = &num_results;
  session = make_session(&options);
  for (i = 0; i < NUM_FRAMES; ++i) {
    plumb_frame frame = make_frame(f, i);
    frame.release = count_release;
    frame.release_user = &num_released;
    EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  }
  memset(&stats, 0, sizeof stats);
  stats.struct_size = sizeof stats;
  do {
    EXPECT(plumb_session_get_stats(session, &stats) == PLUMB_OK);
  } while (stats.num_processed < NUM_FRAMES);
  plumb_session_destroy(session); /* joins: the counters are ours again */
  EXPECT(num_results == NUM_FRAMES);
  EXPECT(num_released == NUM_FRAMES);
}

static void test_destroy_with_frames_in_flight(const fixture* f, const plumb_map* map) {
  int round;
  for (round = 0; round < 5; ++round) {
    plumb_session_options options = make_options(map);
    plumb_session* session;
    int num_released = 0, num_accepted = 0, i;
    options.policy = PLUMB_POLICY_NEWEST;
    options.mode = round % 2 == 0 ? PLUMB_MODE_STREAM : PLUMB_MODE_INDEPENDENT;
    session = make_session(&options);
    for (i = 0; i < NUM_FRAMES; ++i) {
      plumb_frame frame = make_frame(f, i);
      frame.release = count_release;
      frame.release_user = &num_released;
      if (plumb_session_submit_frame(session, &frame) >= 0) ++num_accepted;
    }
    plumb_session_destroy(session);
    EXPECT(num_accepted == NUM_FRAMES);
    EXPECT(num_released == NUM_FRAMES);
  }
}

static void all_tests(const fixture* f, const plumb_map* map) {
  test_frames_in_order(f, map);
  test_detection_options(f, map);
  test_every_mode_and_method(f, map);
  test_callbacks(f, map);
  test_destroy_with_frames_in_flight(f, map);
}

int main(int argc, char** argv) { return run_tests(argc, argv, all_tests); }
