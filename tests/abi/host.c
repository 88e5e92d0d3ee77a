#include "host.h"

#include <math.h>
#include <stdlib.h>

int num_failures = 0;

static int read_numbers(FILE* file, double* out, int count) {
  int i;
  for (i = 0; i < count; ++i) {
    if (fscanf(file, "%lf", &out[i]) != 1) return 0;
  }
  return 1;
}

/* All images have one size. */
static uint8_t* read_image(const char* path, fixture* out) {
  unsigned w, h;
  uint8_t* pixels;
  FILE* file = fopen(path, "rb");
  if (file == NULL || fscanf(file, "P5 %u %u 255", &w, &h) != 2) return NULL;
  fgetc(file);
  out->width_px = w;
  out->height_px = h;
  pixels = malloc((size_t)w * h);
  if (pixels == NULL || fread(pixels, w, h, file) != h) return NULL;
  fclose(file);
  return pixels;
}

static int read_fixture(const char* folder, fixture* out) {
  char path[1100];
  FILE* file;
  int i;
  snprintf(out->map_path, sizeof out->map_path, "%s/map", folder);
  snprintf(path, sizeof path, "%s/poses.txt", folder);
  file = fopen(path, "r");
  if (file == NULL) return 0;
  for (i = 0; i < NUM_FRAMES; ++i) {
    if (!read_numbers(file, out->camera, 4) || !read_numbers(file, out->prior_q[i], 4) ||
        !read_numbers(file, out->prior_t[i], 3) || !read_numbers(file, out->true_q[i], 4) ||
        !read_numbers(file, out->true_t[i], 3)) {
      fclose(file);
      return 0;
    }
  }
  fclose(file);
  for (i = 0; i < NUM_FRAMES; ++i) {
    snprintf(path, sizeof path, "%s/%d.pgm", folder, i);
    out->pixels[i] = read_image(path, out);
    if (out->pixels[i] == NULL) return 0;
  }
  snprintf(path, sizeof path, "%s/radtan.pgm", folder);
  out->through_radtan = read_image(path, out);
  snprintf(path, sizeof path, "%s/fisheye.pgm", folder);
  out->through_fisheye = read_image(path, out);
  return out->through_radtan != NULL && out->through_fisheye != NULL;
}

plumb_frame make_frame(const fixture* f, int i) {
  plumb_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.struct_size = sizeof frame;
  frame.format = PLUMB_FORMAT_GRAY8;
  frame.width_px = f->width_px;
  frame.height_px = f->height_px;
  frame.planes[0] = f->pixels[i];
  frame.row_stride_bytes[0] = f->width_px;
  frame.fx = f->camera[0];
  frame.fy = f->camera[1];
  frame.cx = f->camera[2];
  frame.cy = f->camera[3];
  frame.timestamp_ns = 1000 + i;
  frame.user_tag = 70u + (unsigned)i;
  frame.pose_convention = PLUMB_POSE_CV_CAM_FROM_WORLD;
  memcpy(frame.prior_q_xyzw, f->prior_q[i], sizeof frame.prior_q_xyzw);
  memcpy(frame.prior_t_m, f->prior_t[i], sizeof frame.prior_t_m);
  return frame;
}

plumb_session_options make_options(const plumb_map* map) {
  plumb_session_options options;
  memset(&options, 0, sizeof options);
  options.struct_size = sizeof options;
  options.map = map;
  options.model = "lsd";
  options.policy = PLUMB_POLICY_BLOCK;
  return options;
}

plumb_session* make_session(const plumb_session_options* options) {
  plumb_session* session = NULL;
  EXPECT(plumb_session_create(options, &session) == PLUMB_OK);
  return session;
}

plumb_frame_result empty_result(void) {
  plumb_frame_result result;
  memset(&result, 0, sizeof result);
  result.struct_size = sizeof result;
  return result;
}

plumb_frame_result refine_frame(const plumb_session_options* options, const plumb_frame* frame) {
  plumb_session* session = make_session(options);
  plumb_frame_result result = empty_result();
  EXPECT(plumb_session_submit_frame(session, frame) == PLUMB_OK);
  EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
  EXPECT(result.outcome == PLUMB_OUTCOME_PROCESSED);
  plumb_session_destroy(session);
  return result;
}

double translation_error(const fixture* f, int i, const double t[3]) {
  double sum = 0.0;
  int k;
  for (k = 0; k < 3; ++k) sum += (t[k] - f->true_t[i][k]) * (t[k] - f->true_t[i][k]);
  return sqrt(sum);
}

int run_tests(int argc, char** argv, void (*tests)(const fixture* f, const plumb_map* map)) {
  static fixture f;
  plumb_map* map = NULL;
  int i;
  if (argc != 2 || !read_fixture(argv[1], &f)) {
    fprintf(stderr, "usage: %s FIXTURE\n", argv[0]);
    return 2;
  }
  EXPECT(strcmp(plumb_last_error(), "") == 0);
  if (plumb_map_open(f.map_path, &map) != PLUMB_OK) return 3;
  tests(&f, map);
  plumb_map_destroy(map);
  for (i = 0; i < NUM_FRAMES; ++i) free(f.pixels[i]);
  free(f.through_radtan);
  free(f.through_fisheye);
  if (num_failures > 0) fprintf(stderr, "%d expectations failed\n", num_failures);
  return num_failures == 0 ? 0 : 1;
}
