// SocketCAN for machines without CAN in their kernel: each CAN socket that a program opens, which has this preloaded, is one end
// of a pair. The other ends are the file descriptors 200, 201 and so on of the same process.

#define _GNU_SOURCE
#include <dlfcn.h>
#include <net/if.h>
#include <stdarg.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define FIRST 200
#define MOST 64
#define INDEX 5
#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int opened[MOST];
static int count;

static int is_ours(int fd) {
    for (int i = 0; i < count; i++)
        if (opened[i] == fd)
            return 1;
    return 0;
}

int socket(int domain, int type, int protocol) {
    if (domain != AF_CAN)
        return REAL(socket)(domain, type, protocol);
    int ends[2];
    if (count == MOST || socketpair(AF_UNIX, SOCK_SEQPACKET | (type & (SOCK_NONBLOCK | SOCK_CLOEXEC)), 0, ends) != 0)
        return -1;
    if (dup2(ends[1], FIRST + count) < 0)
        return -1;
    close(ends[1]);
    return opened[count++] = ends[0];
}

int bind(int fd, const struct sockaddr *address, socklen_t length) {
    return is_ours(fd) ? 0 : REAL(bind)(fd, address, length);
}

// Filters and the like: those of SOL_CAN_RAW and above.
int setsockopt(int fd, int level, int name, const void *value, socklen_t length) {
    return is_ours(fd) && level > 100 ? 0 : REAL(setsockopt)(fd, level, name, value, length);
}

unsigned if_nametoindex(const char *name) {
    (void)name;
    return INDEX;
}

int ioctl(int fd, unsigned long request, ...) {
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    if (is_ours(fd) && request == SIOCGIFINDEX) {
        ((struct ifreq *)argument)->ifr_ifindex = INDEX;
        return 0;
    }
    return REAL(ioctl)(fd, request, argument);
}
