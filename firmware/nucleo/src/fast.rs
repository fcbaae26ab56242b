//! Puts the interrupt's code and every constant where `fast.x` links them, before anything runs that needs them.

use core::arch::global_asm;

// Called by cortex-m-rt before memory is set up: it uses registers only. What ran from flash before is not in the pipeline after ISB.
global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =__fast_start",
    "ldr r1, =__fast_end",
    "ldr r2, =__fast_load",
    "0:",
    "cmp r0, r1",
    "bhs 1f",
    "ldr r3, [r2], #4",
    "str r3, [r0], #4",
    "b 0b",
    "1:",
    "ldr r0, =__constants_start",
    "ldr r1, =__constants_end",
    "ldr r2, =__constants_load",
    "2:",
    "cmp r0, r1",
    "bhs 3f",
    "ldr r3, [r2], #4",
    "str r3, [r0], #4",
    "b 2b",
    "3:",
    "dsb",
    "isb",
    "bx lr",
);
