/* A host program in C99: all that a frame can bring beside its image. */
#include <math.h>
#include <stddef.h>

#include "host.h"

/* world_from_cam of a cam_from_world pose, for which q' = conj(q), t' = -R(q') t. */
static void invert_pose(const double q[4], const double t[3], double out_q[4], double out_t[3]) {
  const double x = -q[0], y = -q[1], z = -q[2], w = q[3];
  const double cx = y * t[2] - z * t[1], cy = z * t[0] - x * t[2], cz = x * t[1] - y * t[0];
  out_q[0] = x;
  out_q[1] = y;
  out_q[2] = z;
  out_q[3] = w;
  out_t[0] = -(t[0] + 2.0 * (w * cx + y * cz - z * cy));
  out_t[1] = -(t[1] + 2.0 * (w * cy + z * cx - x * cz));
  out_t[2] = -(t[2] + 2.0 * (w * cz + x * cy - y * cx));
}

/* The same frame in all four conventions gives the same pose. */
static void test_pose_conventions(const fixture* f, const plumb_map* map) {
  static const int32_t conventions[4] = {PLUMB_POSE_CV_CAM_FROM_WORLD, PLUMB_POSE_CV_WORLD_FROM_CAM,
                                         PLUMB_POSE_GL_CAM_FROM_WORLD,
                                         PLUMB_POSE_GL_WORLD_FROM_CAM};
  double reference[3] = {0.0, 0.0, 0.0};
  int c, k;
  for (c = 0; c < 4; ++c) {
    plumb_session_options options = make_options(map);
    plumb_session* session = make_session(&options);
    plumb_frame_result result = empty_result();
    plumb_frame frame = make_frame(f, 0);
    double q[4], t[3];
    memcpy(q, frame.prior_q_xyzw, sizeof q);
    memcpy(t, frame.prior_t_m, sizeof t);
    if (c >= 2) { /* y and z of the camera change their signs: (1, 0, 0, 0) * q */
      const double gl[4] = {q[3], -q[2], q[1], -q[0]};
      memcpy(q, gl, sizeof q);
      t[1] = -t[1];
      t[2] = -t[2];
    }
    if (c % 2 == 1) {
      invert_pose(q, t, frame.prior_q_xyzw, frame.prior_t_m);
    } else {
      memcpy(frame.prior_q_xyzw, q, sizeof q);
      memcpy(frame.prior_t_m, t, sizeof t);
    }
    frame.pose_convention = conventions[c];
    EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
    EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
    EXPECT(result.pose_convention == conventions[c]);
    EXPECT(result.status == PLUMB_STATUS_REFINED);
    memcpy(t, result.t_m, sizeof t);
    if (c % 2 == 1) invert_pose(result.q_xyzw, result.t_m, q, t);
    if (c >= 2) {
      t[1] = -t[1];
      t[2] = -t[2];
    }
    if (c == 0) memcpy(reference, t, sizeof t);
    for (k = 0; k < 3; ++k) EXPECT(fabs(t[k] - reference[k]) < 1e-6);
    plumb_session_destroy(session);
  }
}

static void test_covariance_as_prior(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_frame frame = make_frame(f, 0);
  int k;
  frame.prior_uncertainty = PLUMB_UNCERTAINTY_COVARIANCE;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "prior_covariance");
  for (k = 0; k < 6; ++k) frame.prior_covariance[7 * k] = k < 3 ? 4e-4 : 3.3e-3;
  frame.prior_covariance[1] = 1e-4;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "symmetric");
  frame.prior_covariance[6] = 1e-4;
  frame.prior_covariance[35] = -1.0;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "positive semi-definite");
  frame.prior_covariance[35] = 3.3e-3;
  EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  plumb_session_destroy(session);
}

static void test_points(const fixture* f, const plumb_map* map) {
  const double px[4] = {10, 20, 30, 40}, world[6] = {0, 0, 3, 1, 0, 3};
  double bad[6] = {0, 0, 3, 1, 0, 3};
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_frame frame = make_frame(f, 0);
  frame.num_points = 2;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "points_px");
  bad[4] = NAN;
  frame.points_px = px;
  frame.points_in_world_m = bad;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "points[1]");
  frame.points_in_world_m = world; /* two wrong points change nothing */
  EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  plumb_session_destroy(session);
}

/* Images through a lens are refined as well as those without; the same images taken for a
 * pinhole's are not; a caller from before there were lenses has none. */
static void test_lenses(const fixture* f, const plumb_map* map) {
  const plumb_session_options options = make_options(map);
  plumb_frame frame = make_frame(f, 0);
  plumb_frame_result result;
  frame.planes[0] = f->through_radtan;
  frame.lens_model = PLUMB_LENS_RADTAN;
  frame.lens_distortion[0] = -0.3;
  frame.lens_distortion[1] = 0.1;
  frame.lens_distortion[2] = 0.001;
  frame.lens_distortion[3] = -0.002;
  result = refine_frame(&options, &frame);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  frame.struct_size = (uint32_t)offsetof(plumb_frame, lens_model);
  result = refine_frame(&options, &frame);
  EXPECT(result.status != PLUMB_STATUS_REFINED || translation_error(f, 0, result.t_m) > 0.01);

  frame = make_frame(f, 0);
  frame.planes[0] = f->through_fisheye;
  frame.lens_model = PLUMB_LENS_KANNALA_BRANDT;
  frame.lens_distortion[0] = -0.02;
  frame.lens_distortion[1] = 0.005;
  result = refine_frame(&options, &frame);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
}

static plumb_pose_prior make_prior(const double q[4], const double t[3]) {
  plumb_pose_prior prior;
  memset(&prior, 0, sizeof prior);
  prior.struct_size = sizeof prior;
  memcpy(prior.q_xyzw, q, sizeof prior.q_xyzw);
  memcpy(prior.t_m, t, sizeof prior.t_m);
  return prior;
}

/* As a later version may have it. */
typedef struct longer_prior {
  plumb_pose_prior prior;
  double added;
} longer_prior;

/* The right one of several places is refined, wherever it stands; broken ones are named. */
static void test_more_priors(const fixture* f, const plumb_map* map) {
  const double far_t[3] = {f->true_t[0][0] + 1.0, f->true_t[0][1] - 0.8, f->true_t[0][2] + 0.6};
  const plumb_session_options plain = make_options(map);
  plumb_session_options options = plain;
  plumb_session* session = make_session(&options);
  plumb_pose_prior more[2];
  longer_prior longer[2];
  plumb_frame frame = make_frame(f, 0);
  plumb_frame_result result;
  EXPECT(refine_frame(&plain, &frame).prior_index == 0);
  more[0] = make_prior(f->prior_q[0], far_t);
  more[1] = make_prior(f->prior_q[0], f->prior_t[0]);
  memcpy(frame.prior_t_m, far_t, sizeof far_t);
  result = refine_frame(&plain, &frame);
  EXPECT(result.status != PLUMB_STATUS_REFINED);
  frame.more_priors = more;
  frame.num_more_priors = 2;
  result = refine_frame(&plain, &frame);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(result.prior_index == 2);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  frame.struct_size = (uint32_t)offsetof(plumb_frame, more_priors); /* from before there were any */
  result = refine_frame(&plain, &frame);
  EXPECT(result.status != PLUMB_STATUS_REFINED);
  frame.struct_size = sizeof frame;
  frame.num_more_priors = 1;
  result = refine_frame(&plain, &frame); /* both are wrong: the frame's own is kept */
  EXPECT(result.status != PLUMB_STATUS_REFINED);
  EXPECT(result.prior_index == 0);
  EXPECT(memcmp(result.t_m, far_t, sizeof far_t) == 0);

  /* A newer caller's entries are longer. */
  memset(longer, 0, sizeof longer);
  longer[0].prior = more[0];
  longer[1].prior = more[1];
  longer[0].prior.struct_size = longer[1].prior.struct_size = sizeof longer[0];
  frame.more_priors = &longer[0].prior;
  frame.num_more_priors = 2;
  result = refine_frame(&plain, &frame);
  EXPECT(result.prior_index == 2);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  longer[1].added = 1.0;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_UNSUPPORTED,
               "more_priors[1]");

  frame.more_priors = more;
#define EXPECT_REFUSED(change, part)                                                               \
  do {                                                                                             \
    more[1] = make_prior(f->prior_q[0], f->prior_t[0]);                                            \
    change;                                                                                        \
    EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT, part); \
  } while (0)
  EXPECT_REFUSED(more[1].struct_size = 0, "more_priors[1].struct_size 0");
  EXPECT_REFUSED(more[1].struct_size = sizeof longer[0], "more_priors[1].struct_size 376");
  EXPECT_REFUSED(more[1].uncertainty = 7, "more_priors[1].uncertainty 7");
  EXPECT_REFUSED(more[1].t_m[2] = NAN, "more_priors[1].q_xyzw or t_m is not finite");
  EXPECT_REFUSED(more[1].q_xyzw[0] = 3.0, "more_priors[1].q_xyzw has norm");
  EXPECT_REFUSED(more[1].position_sigma_m = -0.25, "more_priors[1].position_sigma_m -0.25");
  EXPECT_REFUSED(more[1].uncertainty = PLUMB_UNCERTAINTY_COVARIANCE, "more_priors[1].covariance");
  EXPECT_REFUSED(more[0].struct_size = 0, "more_priors[0]: plumb_pose_prior.struct_size 0");
  EXPECT_REFUSED(more[0].struct_size = 369, "more_priors[0].struct_size 369");
  more[0].struct_size = sizeof more[0];
  EXPECT_REFUSED(frame.more_priors = NULL, "more_priors is NULL");
  frame.more_priors = more;
  EXPECT_REFUSED(frame.num_more_priors = PLUMB_MAX_MORE_PRIORS + 1, "num_more_priors 9");
  frame.num_more_priors = 2;
  EXPECT_REFUSED(frame.reserved_priors = 1, "reserved_priors");
  frame.reserved_priors = 0;
#undef EXPECT_REFUSED
  plumb_session_destroy(session);
  options.method = PLUMB_METHOD_PAPER;
  session = make_session(&options);
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "more_priors has 2 entries");
  plumb_session_destroy(session);
}

static void all_tests(const fixture* f, const plumb_map* map) {
  test_pose_conventions(f, map);
  test_covariance_as_prior(f, map);
  test_points(f, map);
  test_lenses(f, map);
  test_more_priors(f, map);
}

int main(int argc, char** argv) { return run_tests(argc, argv, all_tests); }
