/* Simulates /dev/video9 for an unmodified program, as a preload library (LD_PRELOAD).
 *
 * FAKE_VIDEO names a file whose first word says how the camera behaves:
 *   run      new pictures
 *   freeze   no pictures
 *   gone     unplugged: opening fails, and an open device returns ENODEV
 * The other properties are variables of the environment, FAKE_VIDEO_*:
 *   FORMAT     the offered formats, separated by commas: YUYV, MJPG, JPEG
 *   SIZES      the offered sizes, separated by commas; the nearest is used without an error
 *   JPEG       the file with the picture for MJPG and JPEG
 * The camera takes 30 pictures a second, each 5 ms before it delivers the picture.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>
#include <linux/videodev2.h>

#define PADDING 64
static int camera = -1, width, height, stride, is_jpeg, queued[4], n_queued;
static unsigned char *memory[4];
static size_t size;
static unsigned sequence;

static const char *behaviour(void) {
    static char word[16];
    FILE *file = fopen(getenv("FAKE_VIDEO"), "r");
    word[0] = 0;
    if (file) {
        if (fscanf(file, "%15s", word) != 1) word[0] = 0;
        fclose(file);
    }
    return word;
}

static int is(const char *what) { return strcmp(behaviour(), what) == 0; }

static int offers(const char *code) {
    const char *formats = getenv("FAKE_VIDEO_FORMAT");
    return strstr(formats ? formats : "YUYV", code) != NULL;
}

static void set_timer(void) {
    struct itimerspec next = {{0, 0}, {0, 33000000}};
    timerfd_settime(camera, 0, &next, NULL);
}

static int open_camera(void) {
    if (is("gone")) { errno = ENOENT; return -1; }
    camera = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    set_timer();
    n_queued = 0;
    return camera;
}

#define OPEN(name)                                                          \
    int name(const char *path, int flags, ...) {                            \
        va_list rest;                                                       \
        va_start(rest, flags);                                              \
        int mode = va_arg(rest, int);                                       \
        va_end(rest);                                                       \
        if (strcmp(path, "/dev/video9") == 0) return open_camera();         \
        int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, #name);      \
        return real(path, flags, mode);                                     \
    }
OPEN(open)
OPEN(open64)

int close(int fd) {
    int (*real)(int) = dlsym(RTLD_NEXT, "close");
    if (fd == camera) camera = -1;
    return real(fd);
}

#define MMAP(name, offset_t)                                                                  \
    void *name(void *at, size_t length, int prot, int flags, int fd, offset_t offset) {        \
        void *(*real)(void *, size_t, int, int, int, offset_t) = dlsym(RTLD_NEXT, #name);     \
        if (fd < 0 || fd != camera) return real(at, length, prot, flags, fd, offset);         \
        void *fresh = real(at, length, prot, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);             \
        memory[offset / 1048576] = fresh;                                                     \
        return fresh;                                                                         \
    }
MMAP(mmap, off_t)
MMAP(mmap64, off64_t)

static int fail(int why) { errno = why; return -1; }

/* A grey ramp that moves with the sequence, so that no two pictures are equal. */
static size_t paint(unsigned char *to) {
    unsigned step = sequence;
    if (is_jpeg) {
        FILE *file = fopen(getenv("FAKE_VIDEO_JPEG"), "rb");
        size_t n = file ? fread(to, 1, size - 4, file) : 0;
        if (file) fclose(file);
        memcpy(to + n, &step, 4); /* bytes after the end marker are allowed; here they differ */
        return n + 4;
    }
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            to[y * stride + 2 * x] = (unsigned char)(x + y + step);
            to[y * stride + 2 * x + 1] = 128;
        }
    return size;
}

static int dequeue(struct v4l2_buffer *buffer) {
    uint64_t ticks;
    struct timespec now;
    if (read(camera, &ticks, 8) != 8) return fail(EAGAIN);
    set_timer();
    if (is("freeze") || n_queued == 0) return fail(EAGAIN);
    int index = queued[0];
    memmove(queued, queued + 1, --n_queued * sizeof(int));
    clock_gettime(CLOCK_MONOTONIC, &now);
    now.tv_nsec -= 5000000;
    if (now.tv_nsec < 0) { now.tv_sec--; now.tv_nsec += 1000000000; }
    sequence++;
    buffer->index = index;
    buffer->sequence = sequence;
    buffer->bytesused = paint(memory[index]);
    buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    buffer->timestamp.tv_sec = now.tv_sec;
    buffer->timestamp.tv_usec = now.tv_nsec / 1000;
    return 0;
}

/* The offered size with this number; 0 if there are fewer. */
static int offered_size(unsigned number, int *w, int *h) {
    const char *at = getenv("FAKE_VIDEO_SIZES");
    if (!at) at = "160x120";
    for (; number && (at = strchr(at, ',')); number--) at++;
    return at && sscanf(at, "%dx%d", w, h) == 2;
}

static int set_format(struct v4l2_pix_format *pix) {
    long wanted = (long)pix->width * pix->height, nearest = -1;
    int w, h;
    is_jpeg = pix->pixelformat != V4L2_PIX_FMT_YUYV;
    for (unsigned number = 0; offered_size(number, &w, &h); number++)
        if (nearest < 0 || labs((long)w * h - wanted) < nearest) {
            nearest = labs((long)w * h - wanted);
            width = w;
            height = h;
        }
    pix->width = width;
    pix->height = height;
    stride = pix->bytesperline = is_jpeg ? 0 : 2 * width + PADDING;
    size = pix->sizeimage = is_jpeg ? 65536 : (size_t)stride * height;
    return 0;
}

static int answer(unsigned long request, void *data) {
    struct v4l2_fmtdesc *format = data;
    struct v4l2_capability *ability = data;
    struct v4l2_buffer *buffer = data;
    const char *codes[] = {"YUYV", "MJPG", "JPEG"};
    unsigned n = 0;
    if (is("gone")) return fail(ENODEV);
    switch ((unsigned)request) {
    case VIDIOC_QUERYCAP:
        ability->capabilities = V4L2_CAP_DEVICE_CAPS;
        ability->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
    case VIDIOC_ENUM_FMT:
        for (int i = 0; i < 3; i++)
            if (offers(codes[i]) && n++ == format->index) {
                memcpy(&format->pixelformat, codes[i], 4);
                return 0;
            }
        return fail(EINVAL);
    case VIDIOC_ENUM_FRAMESIZES: {
        struct v4l2_frmsizeenum *one = data;
        int w, h;
        if (!offered_size(one->index, &w, &h)) return fail(EINVAL);
        one->type = V4L2_FRMSIZE_TYPE_DISCRETE;
        one->discrete.width = w;
        one->discrete.height = h;
        return 0;
    }
    case VIDIOC_S_FMT:
        return set_format(&((struct v4l2_format *)data)->fmt.pix);
    case VIDIOC_S_PARM:
        return 0;
    case VIDIOC_REQBUFS:
        ((struct v4l2_requestbuffers *)data)->count = 2;
        return 0;
    case VIDIOC_QUERYBUF:
        buffer->m.offset = buffer->index * 1048576;
        buffer->length = size;
        return 0;
    case VIDIOC_QBUF:
        queued[n_queued++] = buffer->index;
        return 0;
    case VIDIOC_DQBUF:
        return dequeue(buffer);
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
        return 0;
    }
    if (_IOC_TYPE(request) == 'V') abort(); /* the program used a wrong request number */
    return fail(ENOTTY);
}

int ioctl(int fd, unsigned long request, ...) {
    va_list rest;
    va_start(rest, request);
    void *data = va_arg(rest, void *);
    va_end(rest);
    if (fd >= 0 && fd == camera) return answer(request, data);
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    return real(fd, request, data);
}
