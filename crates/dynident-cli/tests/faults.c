/* Faults of the operating system, for LD_PRELOAD: the environment variable DYNIDENT_FAULT names one. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static int is_fault(const char *name) {
    const char *fault = getenv("DYNIDENT_FAULT");
    return fault && strcmp(fault, name) == 0;
}

int clock_gettime(clockid_t clock, struct timespec *time) {
    int result = (int)syscall(SYS_clock_gettime, clock, time);
    if (clock == CLOCK_REALTIME && is_fault("year-1811")) time->tv_sec = -5000000000LL;
    if (clock == CLOCK_REALTIME && is_fault("year-36812")) time->tv_sec = 1LL << 40;
    return result;
}

/* A network drive that is gone: what was open is closed, with an error. */
int closedir(DIR *folder) {
    int (*real)(DIR *) = (int (*)(DIR *))dlsym(RTLD_NEXT, "closedir");
    int result = real(folder);
    if (!is_fault("closedir")) return result;
    errno = EIO;
    return -1;
}

int close(int file) {
    int result = (int)syscall(SYS_close, file);
    if (!is_fault("close")) return result;
    errno = EIO;
    return -1;
}

/* The program is killed after it has written a file and before the file has its name. */
int fsync(int file) {
    if (is_fault("kill")) raise(SIGKILL);
    if (is_fault("fsync")) {
        errno = EIO;
        return -1;
    }
    return (int)syscall(SYS_fsync, file);
}
