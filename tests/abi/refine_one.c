/* Refines the pose of one image:
 * refine_one MAP IMAGE.pgm FX FY CX CY QX QY QZ QW TX TY TZ   (cam_from_world; x right, y down) */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <plumbline/plumbline.h>

static int fail(const char* what) {
  fprintf(stderr, "%s: %s\n", what, plumb_last_error());
  return 1;
}

static void print_message(int32_t level, const char* message, void* user) {
  (void)level;
  (void)user;
  fprintf(stderr, "plumbline: %s\n", message);
}

static uint8_t* read_pgm(const char* path, uint32_t* width, uint32_t* height) {
  FILE* file = fopen(path, "rb");
  uint8_t* pixels = NULL;
  unsigned w = 0, h = 0;
  if (file == NULL) return NULL;
  if (fscanf(file, "P5 %u %u 255", &w, &h) == 2 && fgetc(file) != EOF && w > 0 && h > 0 &&
      w <= 16384 && h <= 16384) {
    pixels = malloc((size_t)w * h);
    if (pixels != NULL && fread(pixels, w, h, file) != h) {
      free(pixels);
      pixels = NULL;
    }
  }
  fclose(file);
  *width = w;
  *height = h;
  return pixels;
}

int main(int argc, char** argv) {
  plumb_map* map = NULL;
  plumb_session* session = NULL;
  plumb_session_options options;
  plumb_frame frame;
  plumb_frame_result result;
  uint8_t* pixels;
  int i;
  if (argc != 14) return 2;
  plumb_log_set_callback(print_message, NULL, PLUMB_LOG_WARNING);

  /* Once: the map and a session over it. */
  if (plumb_map_open(argv[1], &map) < 0) return fail("map");
  memset(&options, 0, sizeof options);
  options.struct_size = sizeof options;
  options.map = map;
  if (plumb_session_create(&options, &session) < 0) return fail("session");
  plumb_map_destroy(map); /* the session keeps what it needs */

  /* For every frame: image, intrinsics, time, and a pose that is roughly right. */
  memset(&frame, 0, sizeof frame);
  frame.struct_size = sizeof frame;
  pixels = read_pgm(argv[2], &frame.width_px, &frame.height_px);
  if (pixels == NULL) return 3;
  frame.format = PLUMB_FORMAT_GRAY8;
  frame.planes[0] = pixels;
  frame.row_stride_bytes[0] = frame.width_px;
  frame.fx = atof(argv[3]);
  frame.fy = atof(argv[4]);
  frame.cx = atof(argv[5]);
  frame.cy = atof(argv[6]);
  frame.timestamp_ns = 1;
  frame.pose_convention = PLUMB_POSE_CV_CAM_FROM_WORLD;
  for (i = 0; i < 4; ++i) frame.prior_q_xyzw[i] = atof(argv[7 + i]);
  for (i = 0; i < 3; ++i) frame.prior_t_m[i] = atof(argv[11 + i]);
  frame.prior_position_sigma_m = 0.10;
  frame.prior_rotation_sigma_rad = 0.035;
  if (plumb_session_submit_frame(session, &frame) < 0) return fail("frame");

  /* When it suits you: the results, in the order of the frames. */
  memset(&result, 0, sizeof result);
  result.struct_size = sizeof result;
  if (plumb_session_wait_result(session, INT64_C(60000000000), &result) != PLUMB_OK) return 4;
  printf("%s %.6f %.6f %.6f %.6f %.6f %.6f %.6f\n", plumb_status_string(result.status),
         result.q_xyzw[0], result.q_xyzw[1], result.q_xyzw[2], result.q_xyzw[3], result.t_m[0],
         result.t_m[1], result.t_m[2]);

  plumb_session_destroy(session);
  free(pixels);
  return 0;
}
