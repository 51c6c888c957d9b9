/* Makes syncs a lie, of everything or, with FOLDERS, of folders only: what a harness for power cuts must
   catch, or it proves nothing. */
#define _GNU_SOURCE
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static int lies_about(int file) {
#ifdef FOLDERS
    struct stat found;
    return fstat(file, &found) == 0 && S_ISDIR(found.st_mode);
#else
    (void)file;
    return 1;
#endif
}

int fsync(int file) { return lies_about(file) ? 0 : (int)syscall(SYS_fsync, file); }
int fdatasync(int file) { return lies_about(file) ? 0 : (int)syscall(SYS_fdatasync, file); }
