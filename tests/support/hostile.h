/* What a hostile FMU does, and where: read from resources/hostile.txt as "place action target port when".
 * Every action is bounded, so that it does no harm to the machine where it is not contained. */

#ifdef HOSTILE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>

static struct { char place[32], action[32], target[512]; int port, when, count; double value; int forced; } orders;

static void send_to(int family, int type) {
    int s = socket(family, type, 0);
    struct sockaddr_in in = {.sin_family = AF_INET, .sin_port = htons((unsigned short)orders.port)};
    struct sockaddr_un un = {.sun_family = AF_UNIX};
    in.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    snprintf(un.sun_path, sizeof un.sun_path, "%.100s", orders.target);
    if (s < 0) return;
    if (connect(s, family == AF_UNIX ? (void *)&un : (void *)&in, family == AF_UNIX ? sizeof un : sizeof in) == 0)
        if (write(s, "stolen", 6) < 0) return;
    close(s);
}

static void *doze(void *unused) { sleep(30); return unused; }
static void fill(const char *path, const char *mode) {
    FILE *file = fopen(path, mode);
    if (file) { fputs("overwritten", file); fclose(file); }
}
static int acts(const char *name) { return strcmp(orders.action, name) == 0; }

static void misbehave(void) {
    static char block[1 << 16];
    char name[64];
    if (acts("exit")) exit(0);
    if (acts("quick_exit")) _exit(0);
    if (acts("abort")) abort();
    if (acts("segv")) raise(SIGSEGV);
    if (acts("hang")) for (;;) usleep(10000);
    if (acts("spin")) for (volatile long i = 0;; i++) { }
    if (acts("fork_bomb")) for (int i = 0; i < 100; i++) if (fork() == 0) { sleep(20); _exit(0); }
    if (acts("orphan") && fork() == 0) { sleep(20); _exit(0); }
    if (acts("daemon") && fork() == 0) { setsid(); if (fork() == 0) { sleep(20); } _exit(0); }
    if (acts("shell")) { if (system("sleep 20 &")) return; }
    if (acts("exec")) execl("/bin/sleep", "sleep", "20", (char *)NULL);
    if (acts("flood_stdout")) for (int i = 0; i < 1600; i++) { memset(block, 'x', sizeof block); if (write(1, block, sizeof block) < 0) break; }
    if (acts("flood_descriptors")) {
        for (int fd = 3; fd < 64; fd++) for (int i = 0; i < 1600; i++) if (write(fd, block, sizeof block) <= 0) break;
        sleep(20);
    }
    if (acts("forge")) {
        static const char done[] = "{\"done\": true}\n";
        static const char frame[] = "\0\0\0\0\0\0\0\x15\x93\xc4\x10" "0123456789abcdef" "\0\xc0";
        for (int fd = 3; fd < 64; fd++) if (write(fd, done, sizeof done - 1) < 0 || write(fd, frame, sizeof frame - 1) < 0) continue;
        _exit(0);
    }
    if (acts("nan")) { orders.value = NAN; orders.forced = 1; }
    if (acts("inf")) { orders.value = INFINITY; orders.forced = 1; }
    if (acts("delete")) unlink(orders.target);
    if (acts("truncate")) { if (truncate(orders.target, 0)) return; }
    if (acts("rename")) rename(orders.target, "stolen");
    if (acts("chmod")) chmod(orders.target, 0);
    if (acts("write")) fill(orders.target, "w");
    if (acts("append")) fill(orders.target, "a");
    if (acts("symlink")) { if (symlink(orders.target, "link")) return; fill("link", "w"); }
    if (acts("hard_link")) { if (link(orders.target, "link")) return; fill("link", "w"); }
    if (acts("read")) {
        FILE *file = fopen(orders.target, "r");
        if (file) { orders.value = 42.0; orders.forced = 1; fclose(file); }
    }
    if (acts("tcp")) send_to(AF_INET, SOCK_STREAM);
    if (acts("udp")) send_to(AF_INET, SOCK_DGRAM);
    if (acts("unix")) send_to(AF_UNIX, SOCK_STREAM);
    if (acts("kill_parent")) kill(getppid(), SIGKILL);
    if (acts("stop_parent")) kill(getppid(), SIGSTOP);
    if (acts("trace_parent") && ptrace(PTRACE_ATTACH, getppid(), 0, 0) == 0) sleep(20);
    if (acts("kill_self")) raise(SIGKILL);
    if (acts("stop_self")) raise(SIGSTOP);
    if (acts("close_descriptors")) for (int fd = 0; fd < 64; fd++) close(fd);
    if (acts("replace_descriptors")) { int null = open("/dev/null", O_RDWR); for (int fd = 0; fd < 64; fd++) dup2(null, fd); }
    if (acts("memory")) for (int i = 0; i < 48; i++) { char *p = malloc(1 << 26); if (!p) abort(); memset(p, 1, 1 << 26); hoard = p; usleep(20000); }
    if (acts("disk")) {
        for (int i = 0; i < 600; i++) {
            snprintf(name, sizeof name, "file%d", i);
            FILE *file = fopen(name, "w");
            for (int k = 0; file && k < 16; k++) fwrite(block, sizeof block, 1, file);
            if (file) fclose(file);
        }
        sleep(5);
    }
    if (acts("many_files")) { for (int i = 0; i < 20000; i++) { snprintf(name, sizeof name, "file%d", i); close(open(name, O_CREAT | O_WRONLY, 0600)); } sleep(5); }
    if (acts("deep_folders")) { for (int i = 0; i < 3000; i++) { if (mkdir("d", 0700) || chdir("d")) break; } sleep(5); }
    if (acts("threads")) { pthread_t thread; for (int i = 0; i < 2000; i++) if (pthread_create(&thread, NULL, doze, NULL)) break; sleep(2); }
    if (acts("chdir")) { if (chdir("/")) return; }
    if (acts("fifo")) { Dl_info info; if (dladdr((void *)misbehave, &info)) { remove(info.dli_fname); mkfifo(info.dli_fname, 0600); } mkfifo("fifo", 0600); }
    if (acts("limits")) { struct rlimit most = {RLIM_INFINITY, RLIM_INFINITY}; for (int i = 0; i < 16; i++) setrlimit(i, &most); }
    if (acts("block_signals")) { sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, NULL); for (;;) usleep(10000); }
}

static void at(const char *place) {
    if (strcmp(orders.place, place) == 0 && ++orders.count == (strcmp(place, "step") ? 1 : orders.when)) misbehave();
}

__attribute__((constructor)) static void take_orders(void) {
    Dl_info info;
    char path[1024];
    if (!dladdr((void *)take_orders, &info)) return;
    snprintf(path, sizeof path, "%s", info.dli_fname);
    for (int i = 0; i < 3; i++) { char *slash = strrchr(path, '/'); if (slash) *slash = 0; }
    strncat(path, "/resources/hostile.txt", sizeof path - strlen(path) - 1);
    FILE *file = fopen(path, "r");
    if (!file) return;
    if (fscanf(file, "%31s %31s %511s %d %d", orders.place, orders.action, orders.target, &orders.port, &orders.when) < 5) orders.place[0] = 0;
    fclose(file);
    at("load");
}
#define AT(place) at(#place)
#else
#define AT(place)
#endif
