/* C interface of Plumbline: camera frames with coarse poses in, refined poses out. C99, version 0.
 *
 * Ownership: handles come from plumb_*_open or plumb_*_create and go to plumb_*_destroy, which
 * takes NULL. Pointers passed in are borrowed for the duration of the call unless stated.
 *
 * Results: 0 success, > 0 success with a remark, < 0 error; plumb_last_error() has the text.
 *
 * Structs start with struct_size = sizeof of the caller. Zero the rest, then set what you need:
 * zero means the default unless stated. Members are only ever appended; a size or an input that
 * this library does not know is refused, never ignored.
 *
 * Threads: functions of different handles may be called at once. Of one session: one thread may
 * submit while others poll, wait and read statistics; nothing may run beside its destroy.
 *
 * Callbacks come from any thread, never with a lock of the library held. They must not unwind (no
 * exceptions, no longjmp) and must not destroy the session that calls them.
 *
 * Promises: the library does not throw, abort or print, nor change signal handlers, locale or
 * environment.
 *
 * Conventions: metres, radians, nanoseconds, pixels; the centre of the first pixel is (0, 0);
 * x_in_b = b_from_a * x_in_a; quaternions x, y, z, w.
 */
#ifndef PLUMBLINE_PLUMBLINE_H_
#define PLUMBLINE_PLUMBLINE_H_

#include <stdint.h>

#if defined(_WIN32)
#define PLUMB_API __declspec(dllimport)
#elif defined(__GNUC__)
#define PLUMB_API __attribute__((visibility("default")))
#else
#define PLUMB_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* --- Version ---------------------------------------------------------------------------------- */

#define PLUMB_VERSION_MAJOR 0
#define PLUMB_VERSION_MINOR 1
#define PLUMB_VERSION_PATCH 0
#define PLUMB_MAKE_VERSION(major, minor, patch) \
  (((uint32_t)(major) << 24) | ((uint32_t)(minor) << 12) | (uint32_t)(patch))
#define PLUMB_VERSION \
  PLUMB_MAKE_VERSION(PLUMB_VERSION_MAJOR, PLUMB_VERSION_MINOR, PLUMB_VERSION_PATCH)

/* Version of the library at run time, as PLUMB_MAKE_VERSION packs it. */
PLUMB_API uint32_t plumb_version(void);

/* --- Results ---------------------------------------------------------------------------------- */

typedef int32_t plumb_result;
enum {
  PLUMB_OK = 0,
  PLUMB_NOT_READY = 1,      /* nothing to poll yet */
  PLUMB_TIMEOUT = 2,        /* the time was over; nothing was taken or given */
  PLUMB_FRAME_REPLACED = 3, /* accepted; an older frame that waited was dropped for it */
  PLUMB_ERROR_INVALID_ARGUMENT = -1,
  PLUMB_ERROR_NOT_FOUND = -2,    /* file, model or device */
  PLUMB_ERROR_CORRUPT_DATA = -3, /* wrong magic, checksum or reference */
  PLUMB_ERROR_UNSUPPORTED = -4,
  PLUMB_ERROR_IO = -5,          /* the system refused to read or write a file */
  PLUMB_ERROR_DEVICE_LOST = -6, /* destroy the session and create another one */
  PLUMB_ERROR_OUT_OF_MEMORY = -7,
  PLUMB_ERROR_INTERNAL = -8 /* a bug in this library */
};

/* "PLUMB_OK", ...; "PLUMB_RESULT_UNKNOWN" for other values. Static. */
PLUMB_API const char* plumb_result_string(plumb_result result);

/* One sentence on the last call of this thread that returned an error; "" when there was none.
 * Valid until the next plumb_* call of this thread. Never NULL. */
PLUMB_API const char* plumb_last_error(void);

/* --- Messages --------------------------------------------------------------------------------- */

enum { PLUMB_LOG_DEBUG = 0, PLUMB_LOG_INFO = 1, PLUMB_LOG_WARNING = 2, PLUMB_LOG_ERROR = 3 };

/* `message` is one sentence without a line end, valid during the call. */
typedef void (*plumb_log_callback)(int32_t level, const char* message, void* user);

/* Sends the messages of all sessions, `min_level` and above, to `callback`. NULL drops them, which
 * is the default. Another thread may still be in the former callback on return. */
PLUMB_API plumb_result plumb_log_set_callback(plumb_log_callback callback, void* user,
                                              int32_t min_level);

/* --- Maps ------------------------------------------------------------------------------------- */

/* A line map. Immutable: any number of sessions may use it, and keep it alive by themselves. */
typedef struct plumb_map plumb_map;

typedef struct plumb_map_info {
  uint32_t struct_size;
  uint32_t num_key_frames;
  uint32_t num_lines;           /* fused over views */
  uint32_t num_lifted_segments; /* of single key frames */
  char detector[64];            /* that found the map's segments; a session should use the same */
} plumb_map_info;

/* Reads the map directory `path` (UTF-8), as written by `plumbline map build`, and checks all of
 * it. NOT_FOUND, CORRUPT_DATA, UNSUPPORTED (newer format). */
PLUMB_API plumb_result plumb_map_open(const char* path, plumb_map** out_map);

PLUMB_API plumb_result plumb_map_get_info(const plumb_map* map, plumb_map_info* out_info);

PLUMB_API void plumb_map_destroy(plumb_map* map);

/* --- Sessions --------------------------------------------------------------------------------- */

/* Refines a stream of frames against one map, on one thread of its own. */
typedef struct plumb_session plumb_session;

enum {
  PLUMB_MODE_INDEPENDENT = 0, /* every frame is refined from its own prior */
  PLUMB_MODE_STREAM = 1       /* priors are a tracker's poses; the correction is carried on */
};
enum {
  PLUMB_METHOD_SEARCH = 0, /* searches the prior's uncertainty, then associates softly */
  PLUMB_METHOD_PAPER = 1   /* epipolar matching and joint optimisation as published */
};
enum {
  PLUMB_POLICY_NEWEST = 0, /* a new frame takes the place of one that waits */
  PLUMB_POLICY_BLOCK = 1   /* submitting waits until there is room */
};

typedef void (*plumb_function)(void);
/* vkGetInstanceProcAddr. */
typedef plumb_function (*plumb_vk_get_instance_proc_addr)(void* instance, const char* name);

/* Bits of plumb_vulkan_host.enabled_features: what the host enabled when it created the device. */
enum {
  PLUMB_VULKAN_BUFFER_DEVICE_ADDRESS = 1,
  PLUMB_VULKAN_SHADER_INT64 = 2,
  PLUMB_VULKAN_SHADER_FLOAT64 = 4,
  PLUMB_VULKAN_SHADER_FLOAT16 = 8,
  PLUMB_VULKAN_STORAGE_16BIT = 16,
  PLUMB_VULKAN_STORAGE_8BIT = 32,
  PLUMB_VULKAN_SCALAR_BLOCK_LAYOUT = 64
};

/* A Vulkan 1.2 device of the host program. The handles must outlive the session. */
typedef struct plumb_vulkan_host {
  uint32_t struct_size;
  uint32_t queue_family; /* of `queue`; must support compute */
  plumb_vk_get_instance_proc_addr get_instance_proc_addr;
  void* instance;        /* VkInstance */
  void* physical_device; /* VkPhysicalDevice */
  void* device;          /* VkDevice */
  void* queue;           /* VkQueue */
  /* Called around every use of the queue; both NULL when no other thread uses it. */
  void (*lock_queue)(void* user);
  void (*unlock_queue)(void* user);
  void* user;
  uint32_t enabled_features;
  uint32_t reserved; /* 0 */
} plumb_vulkan_host;

/* plumb_session_options.tile_columns and tile_rows. */
enum { PLUMB_TILES_AUTO = -1 };

/* Bits of plumb_session_options.edge_flags. */
enum {
  PLUMB_EDGE_KEEP_ENDS = 1,      /* segments are not cut to where their edge is */
  PLUMB_EDGE_ONE_BORDER = 2,     /* other borders of bars and thin lines are not added */
  PLUMB_EDGE_KEEP_DUPLICATES = 4 /* of several segments on one edge, all stay */
};

struct plumb_frame_result;
typedef void (*plumb_result_callback)(const struct plumb_frame_result* result, void* user);

typedef struct plumb_session_options {
  uint32_t struct_size;
  int32_t mode;         /* PLUMB_MODE_* */
  int32_t method;       /* PLUMB_METHOD_* */
  int32_t policy;       /* PLUMB_POLICY_* */
  const plumb_map* map; /* required; may be destroyed once the session is created */
  /* Line detector: "lsd", a built-in network ("nano"), or the path of a .safetensors file; NULL:
   * the one that made the map. With model_data set, `model` must be NULL: the file is then read
   * from memory, and the data may be freed once the session is created. */
  const char* model;
  const void* model_data;
  uint64_t model_size_bytes;
  /* Vulkan device of the network: "auto" (same as NULL), "cpu", an index or a part of the name. Not
   * used with vulkan_host, nor by "lsd". */
  const char* device;
  const plumb_vulkan_host* vulkan_host; /* NULL: the library opens a device of its own */
  uint32_t num_hypotheses;              /* of the search, 1..2048; 0: 500 to 1500, by the
                                           prior's size */
  uint32_t max_segments;                /* best detected segments to use, 1..4096; 0: 400 */
  double min_map_support;    /* least share of the visible map to accept a pose, (0, 1); 0: 0.05 */
  uint64_t seed;             /* equal inputs and seeds give equal results */
  int64_t deadline_ns;       /* frames whose lines are found later are not refined; 0: none */
  int64_t submit_timeout_ns; /* longest wait of a blocking submit; 0: no limit */
  uint32_t result_capacity;  /* results kept until polled, 1..1024; 0: 16. When full: the oldest is
                                discarded (NEWEST), or work stops until one is polled (BLOCK) */
  uint32_t reserved;         /* 0 */
  /* When set, gets every result on the session's thread, and none can be polled. `result` is valid
   * during the call. May submit frames under PLUMB_POLICY_NEWEST only. */
  plumb_result_callback on_result;
  void* on_result_user;
  /* What the detector returns. A map's segments were found with its own settings: change these when
   * the camera or the scene asks for it. */
  double score_threshold; /* drops segments with a lower score, 0..1; 0: as the model says */
  double min_length_px;   /* drops shorter ones, 0..100000; 0: none */
  double structural_nms;  /* drops segments whose ends are near a better one's: squared distances in
                             an image of 128 x 128, 0..100000; 2 is usual, 0: off */
  uint32_t top_k; /* at most so many, the best, 1..4096, of each tile; 0: as the model says */
  /* Overlapping tiles for images much larger than the network's input, 1..64 each way; both 0: the
   * whole image at once; both PLUMB_TILES_AUTO: as many as the input's size asks for. */
  int32_t tile_columns, tile_rows;
  /* How segments are moved on to the image's edges. */
  uint32_t edge_flags;       /* PLUMB_EDGE_* bits */
  double edge_min_length_px; /* drops shorter ones, before and after, 1..100000; 0: 12 */
} plumb_session_options;

PLUMB_API plumb_result plumb_session_create(const plumb_session_options* options,
                                            plumb_session** out_session);

/* Waits for the step that the session is in (milliseconds), not for the frames inside: those give
 * no result. Borrowed images are released. */
PLUMB_API void plumb_session_destroy(plumb_session* session);

/* --- Frames ----------------------------------------------------------------------------------- */

/* 8 bit; the chroma of NV12 (U, V), NV21 (V, U) and I420 (planes Y, U, V) is subsampled 2 x 2. */
enum {
  PLUMB_FORMAT_GRAY8 = 1,
  PLUMB_FORMAT_RGB8 = 2,
  PLUMB_FORMAT_BGR8 = 3,
  PLUMB_FORMAT_NV12 = 4,
  PLUMB_FORMAT_NV21 = 5,
  PLUMB_FORMAT_I420 = 6
};

/* What the pose numbers of a frame and of its result mean. CV: camera axes x right, y down, z
 * forward; GL: x right, y up, z backward. There is no default. */
enum {
  PLUMB_POSE_CV_CAM_FROM_WORLD = 1,
  PLUMB_POSE_CV_WORLD_FROM_CAM = 2,
  PLUMB_POSE_GL_CAM_FROM_WORLD = 3,
  PLUMB_POSE_GL_WORLD_FROM_CAM = 4
};

/* The lens. A ray (X, Y, Z) meets the plane z = 1 at x = X / Z, y = Y / Z; the lens moves that to
 * (x', y'), and the pixel is (fx x' + cx, fy y' + cy). Coefficients in OpenCV's order, the rest 0.
 */
enum {
  PLUMB_LENS_NONE = 0,
  PLUMB_LENS_RADTAN = 1,        /* k1 k2 p1 p2 k3 k4 k5 k6 of OpenCV's calib3d; with 4 or 5
                                   coefficients, the others are 0 */
  PLUMB_LENS_KANNALA_BRANDT = 2 /* k1 k2 k3 k4 of OpenCV's fisheye module */
};

enum {
  PLUMB_UNCERTAINTY_SIZES = 0,     /* prior_position_sigma_m, prior_rotation_sigma_rad */
  PLUMB_UNCERTAINTY_COVARIANCE = 1 /* prior_covariance */
};

/* One more place where the camera may be. In an array, struct_size is the distance from one to the
 * next, and the same in all. */
typedef struct plumb_pose_prior {
  uint32_t struct_size;
  int32_t uncertainty; /* PLUMB_UNCERTAINTY_* */
  double q_xyzw[4];    /* in the frame's pose_convention, as all of it */
  double t_m[3];
  double position_sigma_m, rotation_sigma_rad; /* as prior_position_sigma_m of plumb_frame */
  double covariance[36];                       /* as prior_covariance */
} plumb_pose_prior;

/* plumb_frame.num_more_priors at most. */
#define PLUMB_MAX_MORE_PRIORS 8

/* Covariances, here and in results, are row-major 6 x 6 of (rotation w [rad], translation v [m]) in
 * CV camera axes, whatever the pose convention: a camera point moves to exp(w) x + v. */
typedef struct plumb_frame {
  uint32_t struct_size;
  int32_t format; /* PLUMB_FORMAT_*; required */
  uint32_t width_px, height_px;
  const uint8_t* planes[3];
  int64_t row_stride_bytes[3];
  /* Of the image as it is, with the lens below [px]. The camera of the map's key frames is taken as
   * the map corrects it, if it does. */
  double fx, fy, cx, cy;
  int64_t timestamp_ns;      /* of the caller's clock; strictly increasing within a session */
  uint64_t user_tag;         /* comes back in the result */
  int32_t pose_convention;   /* PLUMB_POSE_*; required */
  int32_t prior_uncertainty; /* PLUMB_UNCERTAINTY_* */
  double prior_q_xyzw[4];    /* unit length to 1e-3 */
  double prior_t_m[3];
  /* One standard deviation of the norm of the whole error vector, 1e-9..1000 m and 1e-9..3.2 rad;
   * 0: 0.10 m and 0.0349 rad. In stream mode: of the tracker's drift. */
  double prior_position_sigma_m, prior_rotation_sigma_rad;
  double prior_covariance[36]; /* positive semi-definite; only its size counts today */
  /* Optional 2D-3D correspondences: x, y [px of the image as it is; those that the lens cannot have
   * imaged are left out]; x, y, z in the world [m]; and, or NULL, one standard
   * deviation of each point along the ray of the camera that made it, as a vector in the world [m].
   */
  const double* points_px;
  const double* points_in_world_m;
  const double* points_deviation_m;
  uint32_t num_points;
  uint32_t reserved; /* 0 */
  /* NULL: the image is copied. Otherwise the planes must stay valid until this was called, which
   * happens exactly once for every accepted frame, at the latest in plumb_session_destroy; of a
   * frame that is replaced on the thread that submits the newer one. It may submit a frame. */
  void (*release)(void* user);
  void* release_user;
  int32_t lens_model;        /* PLUMB_LENS_* */
  uint32_t reserved_lens;    /* 0 */
  double lens_distortion[8]; /* see PLUMB_LENS_RADTAN */
  /* Gravity of an inertial sensor: the direction down, of any length, in the camera's axes of
   * pose_convention and in the world; 0, 0, 0 in the camera: not known. Makes the prior's tilt as
   * certain as the standard deviation of either angle of tilt says (0: 0.0175 rad; at most 1).
   * Ignored where it contradicts the prior's rotation by more than 5 deviations. */
  double gravity_in_camera[3];
  double gravity_in_world[3];
  double gravity_sigma_rad;
  /* Beside the prior, other places where the camera may be: hits of a retrieval or a relocaliser, a
   * satellite fix beside a tracked pose. Each is searched as the prior is, and the time grows with
   * their number. The place that the lines speak for is refined (`prior_index` of the result);
   * when they speak for several the status is AMBIGUOUS. Whatever is not REFINED keeps the prior
   * above. In stream mode they are tried when the stream has to be searched for. Gravity serves all
   * of them. Not with PLUMB_METHOD_PAPER. */
  const plumb_pose_prior* more_priors;
  uint32_t num_more_priors; /* up to PLUMB_MAX_MORE_PRIORS */
  uint32_t reserved_priors; /* 0 */
} plumb_frame;

/* Every accepted frame gives exactly one result, in the order of submission.
 * OK, FRAME_REPLACED, TIMEOUT (not accepted); INVALID_ARGUMENT names the broken value; UNSUPPORTED:
 * a newer caller's members are set; DEVICE_LOST; OUT_OF_MEMORY (not accepted). */
PLUMB_API plumb_result plumb_session_submit_frame(plumb_session* session, const plumb_frame* frame);

/* --- Frame results ---------------------------------------------------------------------------- */

enum {
  PLUMB_OUTCOME_PROCESSED = 0,
  PLUMB_OUTCOME_DROPPED = 1, /* a newer frame took its place */
  PLUMB_OUTCOME_LATE = 2,    /* missed its deadline */
  PLUMB_OUTCOME_FAILED = 3   /* `error` and `error_message` say why */
};

/* Of a processed frame; only REFINED changes the pose. */
enum {
  PLUMB_STATUS_NONE = 0, /* the frame was not processed */
  PLUMB_STATUS_REFINED = 1,
  PLUMB_STATUS_KEPT_PRIOR = 2, /* nothing explains the lines better than the prior does */
  PLUMB_STATUS_AMBIGUOUS = 3,  /* a clearly different pose explains the lines as well, or the best
                                  one contradicts the prior */
  PLUMB_STATUS_DEGENERATE = 4, /* the lines leave a direction of the pose unobserved */
  PLUMB_STATUS_LOW_SUPPORT = 5 /* too few lines, or too little of the visible map was found */
};

/* "PLUMB_STATUS_REFINED", ...; "PLUMB_STATUS_UNKNOWN" for other values. Static. */
PLUMB_API const char* plumb_status_string(int32_t status);

typedef struct plumb_frame_result {
  uint32_t struct_size;
  int32_t outcome;      /* PLUMB_OUTCOME_* */
  int32_t status;       /* PLUMB_STATUS_* */
  plumb_result error;   /* of PLUMB_OUTCOME_FAILED */
  uint64_t frame_index; /* counts accepted frames from 0 */
  uint64_t user_tag;
  int64_t timestamp_ns;
  int32_t pose_convention; /* of the frame's prior */
  uint32_t was_searched;   /* 1: the prior's whole uncertainty was searched */
  /* The best pose there is: refined, else the prior; in stream mode, else the tracker's pose with
   * the correction carried on. */
  double q_xyzw[4];
  double t_m[3];
  double covariance[36];            /* see plumb_frame */
  double map_support;               /* share of the visible map that was found, 0..1 */
  double runner_up_ratio;           /* support of the best clearly different pose over this one's;
                                       evidence of other priors' poses, and where only the key
                                       frames' own lines speak for this one */
  uint32_t num_observed_directions; /* of the pose's six, by lines and points */
  uint32_t num_segments, num_matches, num_points_used;
  int64_t wait_ns, detect_ns, ridge_ns, search_ns, refine_ns; /* stages */
  int64_t total_ns;                                           /* from submission to this result */
  char error_message[128]; /* cut if longer; "" unless PLUMB_OUTCOME_FAILED */
  uint32_t prior_index;    /* that a REFINED pose was found from: 0 the frame's prior, k its
                              more_priors[k - 1] */
  uint32_t reserved;       /* 0 */
} plumb_frame_result;

/* Takes the oldest result. OK or NOT_READY. */
PLUMB_API plumb_result plumb_session_poll_result(plumb_session* session,
                                                 plumb_frame_result* out_result);

/* The same, waiting for at most timeout_ns >= 0. OK or TIMEOUT. */
PLUMB_API plumb_result plumb_session_wait_result(plumb_session* session, int64_t timeout_ns,
                                                 plumb_frame_result* out_result);

/* submitted = processed + dropped + late + failed + frames still inside. */
typedef struct plumb_session_stats {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t num_submitted, num_processed, num_dropped, num_late, num_failed;
  uint64_t num_results_discarded; /* not polled in time */
} plumb_session_stats;

PLUMB_API plumb_result plumb_session_get_stats(const plumb_session* session,
                                               plumb_session_stats* out_stats);

#ifdef __cplusplus
}
#endif

#endif /* PLUMBLINE_PLUMBLINE_H_ */
