/* A client of `fowt connect serve` over UDP: the OC3-Hywind pitch controller in C99, for little-endian hosts.
 *
 * cc -std=c99 -O2 -Wall -Wextra -o client client.c && ./client [HOST PORT]
 * after: fowt connect serve --protocol udp --channels GenSpeed,BldPitch1 --wind ntm:18:B --control-dt 0.01
 */
#define _POSIX_C_SOURCE 200112L
#include <netdb.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { HELLO = 1, DESCRIPTION = 2, READY = 3, STATE = 4, COMMAND = 5, END = 7, REFUSED = 8 };
enum { HEADER = 32, LARGEST = 65507 };

struct header { /* 32 bytes without padding */
    char magic[4];
    uint16_t version, kind;
    uint32_t sequence, flags, missed, size;
    double time;
};

static int send_record(int server, uint16_t kind, uint32_t sequence, const double *values, uint32_t count)
{
    char packet[HEADER + 4 * sizeof(double)];
    struct header head = {{'F', 'O', 'W', 'T'}, 1, kind, sequence, 0, 0, count * sizeof(double), 0.0};
    memcpy(packet, &head, HEADER);
    if (count > 0)
        memcpy(packet + HEADER, values, count * sizeof(double));
    return send(server, packet, HEADER + count * sizeof(double), 0) < 0 ? -1 : 0;
}

int main(int argc, char **argv)
{
    static char packet[LARGEST + 1];
    const double period = 0.01, torque = 43.09355; /* s, kN m */
    struct addrinfo hints = {0}, *found;
    struct header head;
    double integral = -1.0;
    int server;

    hints.ai_socktype = SOCK_DGRAM;
    if (getaddrinfo(argc > 2 ? argv[1] : "127.0.0.1", argc > 2 ? argv[2] : "5500", &hints, &found) != 0)
        return 2;
    server = socket(found->ai_family, SOCK_DGRAM, 0);
    if (server < 0 || connect(server, found->ai_addr, found->ai_addrlen) != 0)
        return 2;
    freeaddrinfo(found);
    send_record(server, HELLO, 0, NULL, 0);
    for (;;) {
        ssize_t length = recv(server, packet, LARGEST, 0);
        if (length < HEADER)
            break;
        memcpy(&head, packet, HEADER);
        if (memcmp(head.magic, "FOWT", 4) != 0 || head.version != 1 || (size_t)length != HEADER + head.size)
            continue;
        packet[length] = '\0';
        if (head.kind == DESCRIPTION) {
            send_record(server, READY, 0, NULL, 0);
        } else if (head.kind == STATE && head.size == 2 * sizeof(double)) {
            double values[2], command[2], error, schedule;
            memcpy(values, packet + HEADER, sizeof values); /* GenSpeed (rpm), BldPitch1 (deg) */
            if (integral < 0.0)
                integral = values[1];
            error = values[0] - 1173.7;
            schedule = 1.0 / (1.0 + values[1] / 6.302336);
            integral += 0.00537909 * schedule * error * period;
            integral = integral < 0.0 ? 0.0 : integral > 90.0 ? 90.0 : integral;
            command[0] = torque;
            command[1] = integral + 0.03765362 * schedule * error;
            command[1] = command[1] < 0.0 ? 0.0 : command[1] > 90.0 ? 90.0 : command[1];
            send_record(server, COMMAND, head.sequence, command, 2);
        } else if (head.kind == END || head.kind == REFUSED) {
            puts(packet + HEADER); /* JSON */
            close(server);
            return head.kind == END ? 0 : 1;
        }
    }
    fputs("no server answers\n", stderr);
    close(server);
    return 2;
}
