/* The Bladed interface of a controller in Python, which runs in a process of its own.

   fowt_settings holds a title, the Python interpreter and the settings of the controller, each ended by a zero.
   An export writes them into the built library in place of their mark, so that one library serves all
   controllers and an export needs no compiler where the library is ready.

   The first call starts the process and connects it by a pair of sockets, its standard input; each call sends
   the records and waits for the command; the last call, the end of the host and the unloading of this library
   end the process, which ends by itself where its socket is closed. */

#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include "records.h"
#include "records.c"

extern char **environ;
#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0
#endif

#define MODULE "fowt_env.controllers.export.served"
#define REPLY_SIZE 1036 /* bytes: code (int32), command (4 doubles) and message (1000) of an answer */
#ifndef LONGEST_STEP /* s; a first call compiles kernels */
#define LONGEST_START 900.0
#define LONGEST_STEP 60.0
#define LONGEST_END 5.0
#endif

/* visible, so that no compiler takes its content for known */
char fowt_settings[8192] = "fowt_env: title, interpreter and settings";

static struct {
    int running, socket;
    pid_t child;
} host;

/* Returns a text of fowt_settings, by its number. */
static char *setting(int number)
{
    char *text = fowt_settings;

    while (number-- > 0)
        text += strlen(text) + 1;
    return text;
}

/* Appends a text as far as it fits. */
static void append(char *text, size_t size, const char *more)
{
    size_t at = strlen(text);

    while (at + 1 < size && *more != '\0')
        text[at++] = *more++;
    text[at] = '\0';
}

static double now(void)
{
    struct timespec time;

    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Ends the process: it has some seconds to do so by itself. */
static void finish(void)
{
    double until = now() + LONGEST_END;
    const struct timespec pause = {0, 10000000};

    if (!host.running)
        return;
    host.running = 0;
    close(host.socket);
    while (waitpid(host.child, NULL, WNOHANG) == 0) {
        if (now() > until) {
            kill(host.child, SIGKILL);
            waitpid(host.child, NULL, 0);
            return;
        }
        nanosleep(&pause, NULL);
    }
}

#ifdef __GNUC__
__attribute__((destructor)) static void unload(void)
{
    finish();
}
#endif

/* Starts the process; returns NULL or what is wrong. */
static const char *begin(void)
{
    char *python = setting(1), *arguments[] = {python, "-m", MODULE, setting(2), NULL};
    posix_spawn_file_actions_t actions;
    int pair[2], failed;

    finish();
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0)
        return "no pair of sockets";
    fcntl(pair[0], F_SETFD, FD_CLOEXEC);
    fcntl(pair[1], F_SETFD, FD_CLOEXEC);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pair[1], 0);
    failed = posix_spawn(&host.child, python, &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(pair[1]);
    if (failed) {
        static char text[1100] = "cannot start ";

        close(pair[0]);
        text[13] = '\0';
        append(text, sizeof text, python);
        return text;
    }
    host.socket = pair[0];
    host.running = 1;
    return NULL;
}

/* Sends or receives all bytes before a time; returns 0, 1 for a socket that is closed, 2 for the time. */
static int transfer(char *bytes, size_t size, int sending, double until)
{
    while (size > 0) {
        struct pollfd ready = {host.socket, sending ? POLLOUT : POLLIN, 0};
        double left = until - now();
        ssize_t moved;
        int found = left > 0.0 ? poll(&ready, 1, (int)(1e3 * left) + 1) : 0;
        if (found == 0)
            return 2;
        if (found < 0) {
            if (errno == EINTR)
                continue;
            return 1;
        }
        moved = sending ? send(host.socket, bytes, size, MSG_NOSIGNAL) : recv(host.socket, bytes, size, 0);
        if (moved < 0 && (errno == EINTR || errno == EAGAIN))
            continue;
        if (moved <= 0)
            return 1;
        bytes += moved;
        size -= (size_t)moved;
    }
    return 0;
}

/* Sends the records of a call and waits for the answer; returns NULL or what is wrong. */
static const char *ask(const float *swap, int first, char *reply)
{
    int32_t count = is_extended(swap) ? LAST_EXTENDED : LAST_STANDARD;
    char request[sizeof count + LAST_EXTENDED * sizeof *swap];
    double until = now() + (first ? LONGEST_START : LONGEST_STEP);
    size_t size = (size_t)count * sizeof *swap;
    int failed;

    memcpy(request, &count, sizeof count);
    memcpy(request + sizeof count, swap, size);
    failed = transfer(request, sizeof count + size, 1, until);
    if (!failed)
        failed = transfer(reply, REPLY_SIZE, 0, until);
    if (failed == 2)
        return "the controller's process does not answer in time";
    return failed ? "the controller's process has ended; its messages are on the standard error" : NULL;
}

EXPORTED void DISCON(float *swap, int *fail, const char *infile, const char *outname, char *message)
{
    int status = whole(swap, RECORD_STATUS, -100, 100, -100);
    char reply[REPLY_SIZE + 1], text[REPLY_SIZE + 300] = "";
    const char *wrong = NULL;
    double command[4];
    int32_t code = -1;

    (void)infile; /* all settings are in fowt_settings */
    (void)outname;
    *fail = 0;
    if (status == -1) {
        finish();
        return;
    }
    if (status == 0)
        wrong = begin();
    else if (!host.running)
        wrong = "record 1: the first call must have 0";
    if (wrong == NULL)
        wrong = ask(swap, status == 0, reply);
    if (wrong == NULL) {
        memcpy(&code, reply, sizeof code);
        memcpy(command, reply + sizeof code, sizeof command);
        reply[REPLY_SIZE] = '\0';
        wrong = reply + sizeof code + sizeof command; /* "" without a failure */
    }
    if (code == 0) {
        demand(swap, command);
        return;
    }
    append(text, 300, setting(0));
    append(text, sizeof text, ": ");
    append(text, sizeof text, wrong);
    report(swap, fail, message, -1, text);
    finish();
}
