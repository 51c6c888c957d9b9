/* Counts the file-system calls of a process on paths under FAULT_UNDER, and lets some of them fail. Linux only.

   FAULT_AT     number of the call, from 1; without it calls are only counted
   FAULT_LAST   number of the last call that fails; FAULT_AT by default, 0 for all that follow
   FAULT_MODE   an errno, or "kill" or "hang"
   FAULT_ALSO   number and mode of one more call, such as "17:5"
   FAULT_KIND   only calls of this kind count: "read" (open, read, stat and list) or "write"; both by default
   FAULT_COUNT  file into which the number of calls is written at the end, and before a hang
   CLOCK_OFFSET_S  seconds by which the clock of the calendar is wrong */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum { READ = 1, WRITE = 2 };

static atomic_long calls;
static const char *under, *mode, *count_file, *also_mode;
static long first, last, also;
static int kinds = READ | WRITE;

__attribute__((constructor)) static void start(void) {
    const char *at = getenv("FAULT_AT"), *until = getenv("FAULT_LAST"), *kind = getenv("FAULT_KIND");
    under = getenv("FAULT_UNDER");
    mode = getenv("FAULT_MODE");
    count_file = getenv("FAULT_COUNT");
    first = at ? atol(at) : 0;
    last = until ? atol(until) : first;
    const char *more = getenv("FAULT_ALSO");
    also_mode = more ? strchr(more, ':') : NULL;
    if (also_mode++) also = atol(more);
    else also_mode = NULL;
    if (kind && strcmp(kind, "read") == 0) kinds = READ;
    if (kind && strcmp(kind, "write") == 0) kinds = WRITE;
}

__attribute__((destructor)) static void finish(void) {
    if (!count_file) return;
    char text[32];
    int length = snprintf(text, sizeof text, "%ld", atomic_load(&calls));
    int file = (int)syscall(SYS_openat, AT_FDCWD, count_file, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (file >= 0) {
        syscall(SYS_write, file, text, (size_t)length);
        syscall(SYS_close, file);
    }
}

static int strike(const char *how) {
    if (strcmp(how, "kill") == 0) {
        syscall(SYS_kill, getpid(), SIGKILL);
        for (;;) syscall(SYS_pause);
    }
    if (strcmp(how, "hang") == 0) {
        finish();
        for (;;) usleep(1000000);
    }
    errno = atoi(how);
    return 1;
}

static int fails(int kind) {
    if (!(kinds & kind)) return 0;
    long now = atomic_fetch_add(&calls, 1) + 1;
    if (also_mode && now == also) return strike(also_mode);
    if (first == 0 || !mode || now < first || (last != 0 && now > last)) return 0;
    return strike(mode);
}

/* A path from the current folder counts as one under FAULT_UNDER when the folder and it together do. */
static int path_fails(int kind, const char *path) {
    char whole[8192];
    if (!under || !path) return 0;
    if (path[0] != '/') {
        if (syscall(SYS_getcwd, whole, sizeof whole / 2) < 0) return 0;
        size_t length = strlen(whole);
        snprintf(whole + length, sizeof whole - length, "/%s", path);
        path = whole;
    }
    return strstr(path, under) && fails(kind);
}

static int file_fails(int kind, int file) {
    char link[64], path[4096];
    if (!under) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    long length = syscall(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1);
    if (length <= 0) return 0;
    path[length] = 0;
    return strstr(path, under) && fails(kind);
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int kind_of(int flags) { return flags & (O_WRONLY | O_RDWR | O_CREAT) ? WRITE : READ; }

#define OPEN(name)                                                              \
    int name(const char *path, int flags, ...) {                                \
        va_list rest;                                                           \
        va_start(rest, flags);                                                  \
        mode_t permissions = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0; \
        va_end(rest);                                                           \
        return path_fails(kind_of(flags), path) ? -1 : REAL(name)(path, flags, permissions); \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                            \
    int name(int folder, const char *path, int flags, ...) {                    \
        va_list rest;                                                           \
        va_start(rest, flags);                                                  \
        mode_t permissions = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0; \
        va_end(rest);                                                           \
        return path_fails(kind_of(flags), path) ? -1 : REAL(name)(folder, path, flags, permissions); \
    }
OPENAT(openat)
OPENAT(openat64)

ssize_t read(int file, void *buffer, size_t bytes) {
    return file_fails(READ, file) ? -1 : REAL(read)(file, buffer, bytes);
}
ssize_t pread64(int file, void *buffer, size_t bytes, off64_t at) {
    return file_fails(READ, file) ? -1 : REAL(pread64)(file, buffer, bytes, at);
}
int statx(int folder, const char *restrict path, int flags, unsigned int mask, struct statx *restrict found) {
    /* A null path asks whether the kernel has this call; the header declares that there is none. */
    const char *volatile given = path;
    int stop = given && (given[0] ? path_fails(READ, given) : file_fails(READ, folder));
    return stop ? -1 : REAL(statx)(folder, path, flags, mask, found);
}
int stat64(const char *restrict path, struct stat64 *restrict found) {
    return path_fails(READ, path) ? -1 : REAL(stat64)(path, found);
}
int lstat64(const char *restrict path, struct stat64 *restrict found) {
    return path_fails(READ, path) ? -1 : REAL(lstat64)(path, found);
}
int fstat64(int file, struct stat64 *found) {
    return file_fails(READ, file) ? -1 : REAL(fstat64)(file, found);
}
DIR *opendir(const char *path) { return path_fails(READ, path) ? NULL : REAL(opendir)(path); }
struct dirent64 *readdir64(DIR *folder) {
    return file_fails(READ, dirfd(folder)) ? NULL : REAL(readdir64)(folder);
}

ssize_t write(int file, const void *buffer, size_t bytes) {
    return file_fails(WRITE, file) ? -1 : REAL(write)(file, buffer, bytes);
}
ssize_t writev(int file, const struct iovec *pieces, int count) {
    return file_fails(WRITE, file) ? -1 : REAL(writev)(file, pieces, count);
}
int fsync(int file) { return file_fails(WRITE, file) ? -1 : REAL(fsync)(file); }
int fdatasync(int file) { return file_fails(WRITE, file) ? -1 : REAL(fdatasync)(file); }
int ftruncate64(int file, off64_t bytes) { return file_fails(WRITE, file) ? -1 : REAL(ftruncate64)(file, bytes); }
int mkdir(const char *path, mode_t permissions) {
    return path_fails(WRITE, path) ? -1 : REAL(mkdir)(path, permissions);
}
int rename(const char *from, const char *to) { return path_fails(WRITE, to) ? -1 : REAL(rename)(from, to); }
int link(const char *from, const char *to) { return path_fails(WRITE, to) ? -1 : REAL(link)(from, to); }
int linkat(int from_folder, const char *from, int to_folder, const char *to, int flags) {
    return path_fails(WRITE, to) ? -1 : REAL(linkat)(from_folder, from, to_folder, to, flags);
}
int unlink(const char *path) { return path_fails(WRITE, path) ? -1 : REAL(unlink)(path); }

/* The clock of the calendar, CLOCK_OFFSET_S seconds ahead or, below zero, back. */
int clock_gettime(clockid_t which, struct timespec *now) {
    const char *offset = getenv("CLOCK_OFFSET_S");
    int failed = (int)syscall(SYS_clock_gettime, which, now);
    if (!failed && offset && which == CLOCK_REALTIME) now->tv_sec += atol(offset);
    return failed;
}
