/* Second boot stage. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * The boot ROM copies the first 256 bytes of the flash to the end of the RAM, checks their checksum (uf2.py writes it) and
 * jumps to them. This sets the flash to plain serial reads, which every chip knows, copies the firmware to the RAM and
 * starts it. From then on nothing runs from the flash, so the firmware can write its settings there while it works. */
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .boot2, "ax"

    .global boot2
    .thumb_func
boot2:
    ldr r3, =0x18000000        /* SSI */
    movs r0, #0
    str r0, [r3, #0x08]        /* SSIENR: off, to be set */
    movs r1, #4
    str r1, [r3, #0x14]        /* BAUDR: a quarter of the system clock */
    ldr r1, =(31 << 16 | 3 << 8)
    str r1, [r3, #0x00]        /* CTRLR0: frames of 32 bits; send a command, receive data */
    str r0, [r3, #0x04]        /* CTRLR1: one frame */
    movs r1, #1
    str r1, [r3, #0x10]        /* SER: the flash is selected */
    ldr r1, =(3 << 24 | 2 << 8 | 6 << 2)
    movs r2, #0xF4
    str r1, [r3, r2]           /* SPI_CTRLR0: command 03h of 8 bits, address of 24 bits */
    movs r1, #1
    str r1, [r3, #0x08]

    ldr r0, =__image_in_flash
    ldr r1, =__image
    ldr r2, =__image_end
1:  ldmia r0!, {r4}
    stmia r1!, {r4}
    cmp r1, r2
    blo 1b

    ldr r1, =__image           /* begins with the vectors */
    ldr r0, =0xE000ED08        /* VTOR */
    str r1, [r0]
    ldmia r1!, {r0, r2}
    msr msp, r0
    bx r2
    .ltorg
