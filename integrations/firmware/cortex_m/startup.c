/* From reset to main on the MPS2 boards that QEMU emulates (an386: Cortex-M4F, an500: Cortex-M7), and files through the
 * debugger ("semihosting"). Your board brings its own. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t stack_top[], data_begin[], data_end[], data_load[], bss_begin[], bss_end[];
extern void initialise_monitor_handles(void);
int main(void);

void reset(void) {
    *(volatile uint32_t*)0xE000ED88 |= 0xFU << 20; /* CPACR: the floating-point unit on, before any use of it */
    __asm volatile("dsb\n isb");
    const uint32_t* from = data_load;
    for (uint32_t* to = data_begin; to < data_end;) {
        *to++ = *from++;
    }
    for (uint32_t* to = bss_begin; to < bss_end;) {
        *to++ = 0;
    }
    initialise_monitor_handles();
    exit(main());
}

/* Any fault ends the program with a code that no test mistakes for success. */
static void fault(void) { _Exit(70); }

/* newlib's exit() runs what C++ programs register; there is nothing. */
void _init(void) {}
void _fini(void) {}

__attribute__((section(".vectors"), used)) static const void* const vectors[16] = {
    stack_top, (void*)reset, (void*)fault, (void*)fault, (void*)fault, (void*)fault, (void*)fault, 0,
    0, 0, 0, (void*)fault, (void*)fault, 0, (void*)fault, (void*)fault};
