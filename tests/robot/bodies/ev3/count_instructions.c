/* A plugin for qemu-arm that counts guest instructions, one counter for each guest thread.
 *
 * The counters are in a file that another process may read at any time:
 *   qemu-arm -plugin ./count_instructions.so,into=/path/of/4096/bytes PROGRAM
 * The declarations are those of QEMU's plugin interface, version 1; Debian has no header for it.
 */
#include <fcntl.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>

typedef uint64_t plugin_id;
struct tb;
extern void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, void (*)(plugin_id, struct tb *));
extern void qemu_plugin_register_vcpu_tb_exec_cb(struct tb *, void (*)(unsigned, void *), int,
                                                 void *);
extern size_t qemu_plugin_tb_n_insns(const struct tb *);
int qemu_plugin_version = 1;

#define SLOTS 512
static uint64_t *counts;

static void executed(unsigned thread, void *n) { counts[thread % SLOTS] += (uintptr_t)n; }

static void translated(plugin_id id, struct tb *tb) {
    qemu_plugin_register_vcpu_tb_exec_cb(tb, executed, 0, (void *)qemu_plugin_tb_n_insns(tb));
}

int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv) {
    int file = argc == 1 && strncmp(argv[0], "into=", 5) == 0 ? open(argv[0] + 5, O_RDWR) : -1;
    if (file < 0) return -1;
    counts = mmap(NULL, SLOTS * 8, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (counts == MAP_FAILED) return -1;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    return 0;
}
