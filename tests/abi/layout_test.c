/* The layout of every struct, which no later version may change: only append. */
#include <stddef.h>

#include <plumbline/plumbline.h>

/* An array of negative size where the condition fails; C99 has no static assertion. */
#define CHECK(name, condition) typedef char check_##name[(condition) ? 1 : -1]

#if UINTPTR_MAX == 0xffffffffffffffffu
#define SIZE(lp64, ilp32) (lp64)
#else
#define SIZE(lp64, ilp32) (ilp32)
#endif

CHECK(result_is_32_bit, sizeof(plumb_result) == 4);

CHECK(map_info_size, sizeof(plumb_map_info) == 80);
CHECK(map_info_detector, offsetof(plumb_map_info, detector) == 16);

CHECK(vulkan_size, sizeof(plumb_vulkan_host) == SIZE(80, 48));
CHECK(vulkan_queue, offsetof(plumb_vulkan_host, queue) == SIZE(40, 24));
CHECK(vulkan_features, offsetof(plumb_vulkan_host, enabled_features) == SIZE(72, 40));

CHECK(options_map, offsetof(plumb_session_options, map) == 16);
CHECK(options_model, offsetof(plumb_session_options, model) == SIZE(24, 20));
#if UINTPTR_MAX == 0xffffffffffffffffu
CHECK(options_device, offsetof(plumb_session_options, device) == 48);
CHECK(options_support, offsetof(plumb_session_options, min_map_support) == 72);
CHECK(options_callback, offsetof(plumb_session_options, on_result) == 112);
CHECK(options_detection, offsetof(plumb_session_options, score_threshold) == 128);
CHECK(options_top_k, offsetof(plumb_session_options, top_k) == 152);
CHECK(options_edges, offsetof(plumb_session_options, edge_min_length_px) == 168);
CHECK(options_size, sizeof(plumb_session_options) == 176);
#endif

CHECK(pose_prior_rotation, offsetof(plumb_pose_prior, q_xyzw) == 8);
CHECK(pose_prior_sizes, offsetof(plumb_pose_prior, position_sigma_m) == 64);
CHECK(pose_prior_size, sizeof(plumb_pose_prior) == 368);

CHECK(frame_planes, offsetof(plumb_frame, planes) == 16);
#if UINTPTR_MAX == 0xffffffffffffffffu
CHECK(frame_strides, offsetof(plumb_frame, row_stride_bytes) == 40);
CHECK(frame_time, offsetof(plumb_frame, timestamp_ns) == 96);
CHECK(frame_rotation, offsetof(plumb_frame, prior_q_xyzw) == 120);
CHECK(frame_covariance, offsetof(plumb_frame, prior_covariance) == 192);
CHECK(frame_points, offsetof(plumb_frame, points_px) == 480);
CHECK(frame_release, offsetof(plumb_frame, release) == 512);
CHECK(frame_lens, offsetof(plumb_frame, lens_model) == 528);
CHECK(frame_distortion, offsetof(plumb_frame, lens_distortion) == 536);
CHECK(frame_gravity, offsetof(plumb_frame, gravity_in_camera) == 600);
CHECK(frame_more_priors, offsetof(plumb_frame, more_priors) == 656);
CHECK(frame_size, sizeof(plumb_frame) == 672);
#endif

CHECK(frame_result_index, offsetof(plumb_frame_result, frame_index) == 16);
CHECK(frame_result_rotation, offsetof(plumb_frame_result, q_xyzw) == 48);
CHECK(frame_result_covariance, offsetof(plumb_frame_result, covariance) == 104);
CHECK(frame_result_support, offsetof(plumb_frame_result, map_support) == 392);
CHECK(frame_result_times, offsetof(plumb_frame_result, wait_ns) == 424);
CHECK(frame_result_message, offsetof(plumb_frame_result, error_message) == 472);
CHECK(frame_result_prior, offsetof(plumb_frame_result, prior_index) == 600);
CHECK(frame_result_size, sizeof(plumb_frame_result) == 608);

CHECK(stats_size, sizeof(plumb_session_stats) == 56);

int plumb_layout_is_checked_by_the_compiler(void);
int plumb_layout_is_checked_by_the_compiler(void) { return 0; }
