// Calls that change files fail on purpose. Preloaded (LD_PRELOAD), this library stands between a program and the C library.
//
// Counted are calls on paths below one folder: open for writing, write, sync, truncate, rename, link, unlink, mkdir, rmdir,
// copies. `arm` sets the folder and which of them fails, in which way. The paths of open files come from /proc/self/fd.
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum action { COUNT, FULL, BROKEN, KILLED };  // as test/reliability/shim.py has them
enum needs { NO_SPACE, SPACE };               // a full disk still renames and removes

static char folder[PATH_MAX];
static size_t length;
static long at;
static enum action action;
static int trace = -1;
static atomic_long counted;

// The calls on paths below `below` count from now on; the `n`-th fails. What is counted is written to the descriptor `to`.
void arm(const char *below, long n, int how, int to) {
    length = strlen(below);
    memcpy(folder, below, length + 1);
    at = n;
    action = (enum action)how;
    trace = to;
    counted = 0;
}

static int below_folder(const char *path) {
    return length && !strncmp(path, folder, length) && (path[length] == '/' || !path[length]);
}

static int path_of(int descriptor, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t size = syscall(SYS_readlinkat, AT_FDCWD, link, path, PATH_MAX - 1);
    path[size < 0 ? 0 : size] = 0;
    return size > 0;
}

static void absolute(int directory, const char *path, char *whole) {
    whole[0] = 0;
    if (path[0] == '/') {
        snprintf(whole, PATH_MAX, "%s", path);
        return;
    }
    char base[PATH_MAX];
    if (directory == AT_FDCWD) {
        if (syscall(SYS_getcwd, base, sizeof base) < 0) return;
    } else if (!path_of(directory, base)) {
        return;
    }
    snprintf(whole, PATH_MAX, "%.2000s/%.2000s", base, path);
}

// What is to become of a call: COUNT where it goes on as ever.
static enum action fate(const char *what, const char *path, enum needs needs) {
    if (!below_folder(path)) return COUNT;
    long n = ++counted;
    if (trace >= 0) {
        char line[PATH_MAX + 64];
        int size = snprintf(line, sizeof line, "%s %s\n", what, path + length);
        syscall(SYS_write, trace, line, (size_t)size);
    }
    if (!at || n < at || action == COUNT) return COUNT;
    if (n == at) return action;
    return action == FULL && needs == SPACE ? FULL : COUNT;
}

static void die(void) {
    syscall(SYS_kill, syscall(SYS_getpid), SIGKILL);
    for (;;) pause();
}

// The error of a call that is not made at all.
static int refused(enum action fate_of_call) {
    if (fate_of_call == COUNT) return 0;
    if (fate_of_call == KILLED) die();
    errno = fate_of_call == FULL ? ENOSPC : EIO;
    return 1;
}

#define ON_PATH(what, directory, path, needs)                       \
    do {                                                            \
        char whole[PATH_MAX];                                       \
        absolute(directory, path, whole);                           \
        if (refused(fate(what, whole, needs))) return -1;           \
    } while (0)

#define ON_FILE(what, descriptor, needs)                            \
    do {                                                            \
        char whole[PATH_MAX];                                       \
        if (length && path_of(descriptor, whole) && refused(fate(what, whole, needs))) return -1; \
    } while (0)

static int opened(int directory, const char *path, int flags, mode_t mode) {
    if ((flags & O_ACCMODE) != O_RDONLY || (flags & (O_CREAT | O_TRUNC))) ON_PATH("open", directory, path, SPACE);
    return (int)syscall(SYS_openat, directory, path, flags, mode);
}

#define MODE(flags, after)                                          \
    mode_t mode = 0;                                                \
    if ((flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE) {    \
        va_list more;                                               \
        va_start(more, after);                                      \
        mode = va_arg(more, mode_t);                                \
        va_end(more);                                               \
    }

int open(const char *path, int flags, ...) {
    MODE(flags, flags)
    return opened(AT_FDCWD, path, flags, mode);
}
int open64(const char *path, int flags, ...) {
    MODE(flags, flags)
    return opened(AT_FDCWD, path, flags, mode);
}
int openat(int directory, const char *path, int flags, ...) {
    MODE(flags, flags)
    return opened(directory, path, flags, mode);
}
int openat64(int directory, const char *path, int flags, ...) {
    MODE(flags, flags)
    return opened(directory, path, flags, mode);
}
int creat(const char *path, mode_t mode) { return opened(AT_FDCWD, path, O_CREAT | O_WRONLY | O_TRUNC, mode); }
int creat64(const char *path, mode_t mode) { return creat(path, mode); }

// A write that fails is torn: its first half is made. A disk that fills up takes that half and says so by the number of bytes,
// and nothing of what comes after it.
static ssize_t written(int descriptor, const void *data, size_t size, off_t offset, int here) {
    char path[PATH_MAX];
    enum action what = length && path_of(descriptor, path) ? fate("write", path, SPACE) : COUNT;
    size_t part = what == COUNT ? size : what == BROKEN || counted > at ? 0 : size / 2;
    ssize_t done = 0;
    if (part || what == COUNT)
        done = here ? syscall(SYS_write, descriptor, data, part) : syscall(SYS_pwrite64, descriptor, data, part, offset);
    if (what == COUNT || (what == FULL && done > 0 && counted == at)) return done;
    refused(what);
    return -1;
}
ssize_t write(int descriptor, const void *data, size_t size) { return written(descriptor, data, size, 0, 1); }
ssize_t pwrite(int descriptor, const void *data, size_t size, off_t offset) {
    return written(descriptor, data, size, offset, 0);
}
ssize_t pwrite64(int descriptor, const void *data, size_t size, off64_t offset) {
    return written(descriptor, data, size, offset, 0);
}
ssize_t writev(int descriptor, const struct iovec *parts, int count) {
    ON_FILE("write", descriptor, SPACE);
    return syscall(SYS_writev, descriptor, parts, count);
}
ssize_t pwritev(int descriptor, const struct iovec *parts, int count, off_t offset) {
    ON_FILE("write", descriptor, SPACE);
    return syscall(SYS_pwritev, descriptor, parts, count, offset, 0L);
}
ssize_t pwritev64(int descriptor, const struct iovec *parts, int count, off64_t offset) {
    return pwritev(descriptor, parts, count, offset);
}
ssize_t sendfile(int to, int from, off_t *offset, size_t size) {
    ON_FILE("write", to, SPACE);
    return syscall(SYS_sendfile, to, from, offset, size);
}
ssize_t sendfile64(int to, int from, off64_t *offset, size_t size) { return sendfile(to, from, offset, size); }
ssize_t copy_file_range(int from, off64_t *read_at, int to, off64_t *write_at, size_t size, unsigned flags) {
    ON_FILE("write", to, SPACE);
    return syscall(SYS_copy_file_range, from, read_at, to, write_at, size, flags);
}

int fsync(int descriptor) {
    ON_FILE("sync", descriptor, SPACE);
    return (int)syscall(SYS_fsync, descriptor);
}
int fdatasync(int descriptor) {
    ON_FILE("sync", descriptor, SPACE);
    return (int)syscall(SYS_fdatasync, descriptor);
}
int ftruncate(int descriptor, off_t size) {
    ON_FILE("truncate", descriptor, NO_SPACE);
    return (int)syscall(SYS_ftruncate, descriptor, size);
}
int ftruncate64(int descriptor, off64_t size) { return ftruncate(descriptor, size); }
int fallocate(int descriptor, int mode, off_t offset, off_t size) {
    ON_FILE("allocate", descriptor, SPACE);
    return (int)syscall(SYS_fallocate, descriptor, mode, offset, size);
}
int fallocate64(int descriptor, int mode, off64_t offset, off64_t size) { return fallocate(descriptor, mode, offset, size); }

static int renamed(int from, const char *old, int to, const char *new, unsigned flags) {
    ON_PATH("rename", to, new, NO_SPACE);
    return (int)syscall(SYS_renameat2, from, old, to, new, flags);
}
int rename(const char *old, const char *new) { return renamed(AT_FDCWD, old, AT_FDCWD, new, 0); }
int renameat(int from, const char *old, int to, const char *new) { return renamed(from, old, to, new, 0); }
int renameat2(int from, const char *old, int to, const char *new, unsigned flags) { return renamed(from, old, to, new, flags); }
int linkat(int from, const char *old, int to, const char *new, int flags) {
    ON_PATH("link", to, new, SPACE);
    return (int)syscall(SYS_linkat, from, old, to, new, flags);
}
int link(const char *old, const char *new) { return linkat(AT_FDCWD, old, AT_FDCWD, new, 0); }
int symlink(const char *old, const char *new) {
    ON_PATH("link", AT_FDCWD, new, SPACE);
    return (int)syscall(SYS_symlinkat, old, AT_FDCWD, new);
}
int unlinkat(int directory, const char *path, int flags) {
    ON_PATH(flags & AT_REMOVEDIR ? "rmdir" : "unlink", directory, path, NO_SPACE);
    return (int)syscall(SYS_unlinkat, directory, path, flags);
}
int unlink(const char *path) { return unlinkat(AT_FDCWD, path, 0); }
int rmdir(const char *path) { return unlinkat(AT_FDCWD, path, AT_REMOVEDIR); }
int remove(const char *path) {
    int done = unlink(path);
    return done && errno == EISDIR ? rmdir(path) : done;
}
int mkdirat(int directory, const char *path, mode_t mode) {
    ON_PATH("mkdir", directory, path, SPACE);
    return (int)syscall(SYS_mkdirat, directory, path, mode);
}
int mkdir(const char *path, mode_t mode) { return mkdirat(AT_FDCWD, path, mode); }
