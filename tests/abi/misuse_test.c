/* A host program in C99 that uses the interface in every wrong way there is. */
#include <math.h>

#include "host.h"

static void test_maps(const fixture* f) {
  plumb_map* map = NULL;
  plumb_map_info info;
  EXPECT(plumb_map_open(f->map_path, &map) == PLUMB_OK);
  memset(&info, 0, sizeof info);
  info.struct_size = sizeof info;
  EXPECT(plumb_map_get_info(map, &info) == PLUMB_OK);
  EXPECT(info.struct_size == sizeof info);
  EXPECT(info.num_key_frames == 5);
  EXPECT(info.num_lines > 50);
  EXPECT(info.num_lifted_segments > info.num_lines);
  EXPECT(strcmp(info.detector, "lsd") == 0);
  EXPECT_ERROR(plumb_map_get_info(NULL, &info), PLUMB_ERROR_INVALID_ARGUMENT, "map");
  EXPECT_ERROR(plumb_map_get_info(map, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "plumb_map_info");
  info.struct_size = 0;
  EXPECT_ERROR(plumb_map_get_info(map, &info), PLUMB_ERROR_INVALID_ARGUMENT, "struct_size 0");
  plumb_map_destroy(map);
  plumb_map_destroy(NULL);
  map = (plumb_map*)&info;
  EXPECT_ERROR(plumb_map_open("/nowhere/at/all", &map), PLUMB_ERROR_NOT_FOUND, "/nowhere/at/all");
  EXPECT(map == NULL);
  EXPECT_ERROR(plumb_map_open(NULL, &map), PLUMB_ERROR_INVALID_ARGUMENT, "path");
  EXPECT_ERROR(plumb_map_open(f->map_path, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "out_map");
}

static void test_broken_frames(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  const plumb_frame good = make_frame(f, 0);
  plumb_frame frame;
  unsigned char larger[sizeof(plumb_frame) + 8];
  uint32_t larger_size = sizeof larger;
#define EXPECT_REFUSED(change, part)                                                               \
  do {                                                                                             \
    frame = good;                                                                                  \
    change;                                                                                        \
    EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT, part); \
  } while (0)
  EXPECT_REFUSED(frame.struct_size = 4, "struct_size 4");
  EXPECT_REFUSED(frame.struct_size = 0, "struct_size 0");
  EXPECT_REFUSED(frame.struct_size = 0xffffffffu, "struct_size");
  EXPECT_REFUSED(frame.struct_size = sizeof frame - 1, "struct_size");
  EXPECT_REFUSED(frame.prior_position_sigma_m = 2000.0, "position_sigma_m 2000");
  EXPECT_REFUSED(frame.format = 0, "format 0");
  EXPECT_REFUSED(frame.format = 99, "format 99");
  EXPECT_REFUSED(frame.width_px = 0, "width_px");
  EXPECT_REFUSED(frame.height_px = 0xffffffffu, "16384");
  EXPECT_REFUSED(frame.planes[0] = NULL, "planes[0]");
  EXPECT_REFUSED(frame.row_stride_bytes[0] = frame.width_px - 1, "row_stride_bytes");
  EXPECT_REFUSED(frame.row_stride_bytes[0] = -1000, "row_stride_bytes");
  EXPECT_REFUSED(frame.format = PLUMB_FORMAT_NV12, "planes[1]");
  EXPECT_REFUSED(frame.fx = 0.0, "camera");
  EXPECT_REFUSED(frame.cy = NAN, "camera");
  EXPECT_REFUSED(frame.pose_convention = 0, "pose_convention 0");
  EXPECT_REFUSED(frame.pose_convention = 5, "pose_convention 5");
  EXPECT_REFUSED(frame.prior_t_m[1] = NAN, "not finite");
  EXPECT_REFUSED(frame.prior_q_xyzw[3] = INFINITY, "not finite");
  EXPECT_REFUSED(memset(frame.prior_q_xyzw, 0, sizeof frame.prior_q_xyzw), "norm 0");
  EXPECT_REFUSED(frame.prior_uncertainty = 7, "prior_uncertainty 7");
  EXPECT_REFUSED(frame.prior_position_sigma_m = -0.1, "position_sigma_m");
  EXPECT_REFUSED(frame.prior_rotation_sigma_rad = NAN, "rotation_sigma_rad");
  EXPECT_REFUSED(frame.num_points = 0xffffffffu, "num_points");
  EXPECT_REFUSED(frame.reserved = 1, "reserved");
  EXPECT_REFUSED(frame.lens_model = 3, "lens_model 3");
  EXPECT_REFUSED(frame.lens_model = -1, "lens_model -1");
  EXPECT_REFUSED(frame.reserved_lens = 1, "reserved_lens");
  EXPECT_REFUSED(frame.lens_distortion[0] = 0.1, "lens_distortion[0] 0.1");
  EXPECT_REFUSED(frame.lens_model = PLUMB_LENS_KANNALA_BRANDT;
                 frame.lens_distortion[4] = 0.1, "lens_distortion[4] 0.1");
  EXPECT_REFUSED(frame.lens_model = PLUMB_LENS_RADTAN;
                 frame.lens_distortion[7] = NAN, "lens_distortion[7] nan");
  EXPECT_REFUSED(frame.lens_model = PLUMB_LENS_RADTAN; frame.lens_distortion[0] = -1e9, "camera");
  EXPECT_REFUSED(frame.gravity_in_camera[0] = NAN, "gravity in the camera");
  EXPECT_REFUSED(frame.gravity_in_camera[1] = 9.8, "gravity in the world (0, 0, 0)");
  EXPECT_REFUSED(frame.gravity_in_camera[1] = 9.8; frame.gravity_in_world[1] = 1.0;
                 frame.gravity_sigma_rad = -0.1, "gravity uncertainty -0.1");
#undef EXPECT_REFUSED
  EXPECT_ERROR(plumb_session_submit_frame(session, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_ERROR(plumb_session_submit_frame(NULL, &good), PLUMB_ERROR_INVALID_ARGUMENT, "session");
  /* A newer caller: welcome while it uses nothing that this library does not know. */
  memset(larger, 0, sizeof larger);
  memcpy(larger, &good, sizeof good);
  memcpy(larger, &larger_size, sizeof larger_size);
  larger[sizeof good + 3] = 1;
  EXPECT_ERROR(plumb_session_submit_frame(session, (const plumb_frame*)(const void*)larger),
               PLUMB_ERROR_UNSUPPORTED, "does not know");
  larger[sizeof good + 3] = 0;
  EXPECT(plumb_session_submit_frame(session, (const plumb_frame*)(const void*)larger) == PLUMB_OK);
  frame = good;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "timestamp_ns");
  plumb_session_destroy(session);
}

static void test_broken_options(const plumb_map* map) {
  const plumb_session_options good = make_options(map);
  plumb_session_options options;
  plumb_session* session = NULL;
#define EXPECT_REFUSED(change, code, part)                              \
  do {                                                                  \
    options = good;                                                     \
    change;                                                             \
    session = (plumb_session*)&options;                                 \
    EXPECT_ERROR(plumb_session_create(&options, &session), code, part); \
    EXPECT(session == NULL);                                            \
  } while (0)
  EXPECT_REFUSED(options.struct_size = 8, PLUMB_ERROR_INVALID_ARGUMENT, "struct_size 8");
  EXPECT_REFUSED(options.map = NULL, PLUMB_ERROR_INVALID_ARGUMENT, "options.map");
  EXPECT_REFUSED(options.mode = 2, PLUMB_ERROR_INVALID_ARGUMENT, "mode 2");
  EXPECT_REFUSED(options.method = -1, PLUMB_ERROR_INVALID_ARGUMENT, "method -1");
  EXPECT_REFUSED(options.policy = 9, PLUMB_ERROR_INVALID_ARGUMENT, "policy 9");
  EXPECT_REFUSED(options.reserved = 1, PLUMB_ERROR_INVALID_ARGUMENT, "reserved");
  EXPECT_REFUSED(options.num_hypotheses = 5000, PLUMB_ERROR_INVALID_ARGUMENT, "num_hypotheses");
  EXPECT_REFUSED(options.max_segments = 5000, PLUMB_ERROR_INVALID_ARGUMENT, "max_segments");
  EXPECT_REFUSED(options.min_map_support = 1.5, PLUMB_ERROR_INVALID_ARGUMENT, "min_map_support");
  EXPECT_REFUSED(options.min_map_support = NAN, PLUMB_ERROR_INVALID_ARGUMENT, "min_map_support");
  EXPECT_REFUSED(options.deadline_ns = -1, PLUMB_ERROR_INVALID_ARGUMENT, "deadline_ns");
  EXPECT_REFUSED(options.submit_timeout_ns = -1, PLUMB_ERROR_INVALID_ARGUMENT, "submit_timeout_ns");
  EXPECT_REFUSED(options.result_capacity = 9999, PLUMB_ERROR_INVALID_ARGUMENT, "result_capacity");
  EXPECT_REFUSED(options.score_threshold = 1.5, PLUMB_ERROR_INVALID_ARGUMENT,
                 "score_threshold 1.5");
  EXPECT_REFUSED(options.score_threshold = NAN, PLUMB_ERROR_INVALID_ARGUMENT,
                 "score_threshold nan");
  EXPECT_REFUSED(options.min_length_px = -1.0, PLUMB_ERROR_INVALID_ARGUMENT, "min_length_px -1");
  EXPECT_REFUSED(options.structural_nms = 2e5, PLUMB_ERROR_INVALID_ARGUMENT,
                 "structural_nms 200000");
  EXPECT_REFUSED(options.top_k = 5000, PLUMB_ERROR_INVALID_ARGUMENT, "top_k 5000");
  EXPECT_REFUSED(options.tile_columns = 2, PLUMB_ERROR_INVALID_ARGUMENT, "2 x 0");
  EXPECT_REFUSED(options.tile_rows = PLUMB_TILES_AUTO, PLUMB_ERROR_INVALID_ARGUMENT, "0 x -1");
  EXPECT_REFUSED(options.tile_columns = options.tile_rows = 65, PLUMB_ERROR_INVALID_ARGUMENT,
                 "65 x 65");
  EXPECT_REFUSED(options.edge_flags = 8, PLUMB_ERROR_INVALID_ARGUMENT, "edge_flags 8");
  EXPECT_REFUSED(options.edge_min_length_px = 0.5, PLUMB_ERROR_INVALID_ARGUMENT,
                 "edge_min_length_px 0.5");
  EXPECT_REFUSED(options.model_data = &good, PLUMB_ERROR_INVALID_ARGUMENT, "model_data");
  EXPECT_REFUSED(options.model_size_bytes = 7, PLUMB_ERROR_INVALID_ARGUMENT, "model_size_bytes");
#undef EXPECT_REFUSED
  EXPECT_ERROR(plumb_session_create(NULL, &session), PLUMB_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_ERROR(plumb_session_create(&good, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "out_session");
}

static void test_other_misuse(const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_session_stats stats;
  memset(&stats, 0, sizeof stats);
  EXPECT_ERROR(plumb_session_poll_result(NULL, &result), PLUMB_ERROR_INVALID_ARGUMENT, "session");
  EXPECT_ERROR(plumb_session_poll_result(session, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_ERROR(plumb_session_wait_result(session, -1, &result), PLUMB_ERROR_INVALID_ARGUMENT,
               "timeout_ns");
  EXPECT_ERROR(plumb_session_get_stats(session, &stats), PLUMB_ERROR_INVALID_ARGUMENT,
               "struct_size 0");
  EXPECT_ERROR(plumb_session_get_stats(NULL, &stats), PLUMB_ERROR_INVALID_ARGUMENT, "session");
  EXPECT_ERROR(plumb_log_set_callback(NULL, NULL, 17), PLUMB_ERROR_INVALID_ARGUMENT, "min_level");
  result.struct_size = sizeof result - 1;
  EXPECT_ERROR(plumb_session_poll_result(session, &result), PLUMB_ERROR_INVALID_ARGUMENT,
               "struct_size");
  result.struct_size = 12;
  EXPECT_ERROR(plumb_session_poll_result(session, &result), PLUMB_ERROR_INVALID_ARGUMENT,
               "struct_size 12");
  plumb_session_destroy(session);
  plumb_session_destroy(NULL);
}

static void test_strings(void) {
  EXPECT(plumb_version() == PLUMB_VERSION);
  EXPECT(strcmp(plumb_result_string(PLUMB_OK), "PLUMB_OK") == 0);
  EXPECT(strcmp(plumb_result_string(PLUMB_ERROR_IO), "PLUMB_ERROR_IO") == 0);
  EXPECT(strcmp(plumb_result_string(-1000), "PLUMB_RESULT_UNKNOWN") == 0);
  EXPECT(strcmp(plumb_status_string(PLUMB_STATUS_REFINED), "PLUMB_STATUS_REFINED") == 0);
  EXPECT(strcmp(plumb_status_string(99), "PLUMB_STATUS_UNKNOWN") == 0);
}

static void all_tests(const fixture* f, const plumb_map* map) {
  test_strings();
  test_maps(f);
  test_broken_frames(f, map);
  test_broken_options(map);
  test_other_misuse(map);
}

int main(int argc, char** argv) { return run_tests(argc, argv, all_tests); }
