/* Settings of the RP2040 in its flash, and the flash's number. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Uses only commands that serial flashes of all makers share (data sheet of the W25Q16), and no function of the boot ROM. */
#ifdef SLAMD_RP2040

#include "rp2040.h"
#include "slamd_port.h"
#include "slamd_protocol.h"

#define SECTOR 4096UL
#define PAGE 256UL
#define PAGES (SECTOR / PAGE)
#define STORE_AT (2 * 1024 * 1024UL - 2 * SECTOR) /* the end of a Pico's flash */
#define MAGIC 0x646D6C73UL
#define SETTLE_US 50000UL /* after the last changed byte */
#define TRIES 4

/* A copy of the settings. Each page of two sectors holds one; the newest counts. Only when a sector is full the other one is
 * erased, so a copy that is whole is always there. */
struct copy {
    uint32_t magic, number;
    uint8_t bytes[96];
    uint32_t crc;
};

static struct copy copy;
static uint8_t page, tries;
static bool changed;
static uint32_t changed_us;
static enum { IDLE, ERASING, WRITING } storing;
static uint8_t uid[8];

/* By hand: an interrupt between two bytes must not end a command. */
static void flash_select(bool selected) {
    FLASH_SELECT = selected ? 2UL << 8 : 3UL << 8;
    (void)FLASH_SELECT;
}

static uint8_t flash_byte(uint8_t byte) {
    SSI_DATA = byte;
    while (!(SSI_STATUS & 8)) {
    }
    return (uint8_t)SSI_DATA;
}

static void flash_command(uint8_t command, uint32_t at) {
    flash_select(true);
    flash_byte(command);
    for (int8_t shift = 16; shift >= 0; shift -= 8) flash_byte((uint8_t)(at >> shift));
}

static void flash_write_enable(void) {
    flash_select(true);
    flash_byte(0x06);
    flash_select(false);
}

static bool flash_is_busy(void) {
    flash_select(true);
    flash_byte(0x05);
    uint8_t status = flash_byte(0);
    flash_select(false);
    return status & 1;
}

static void flash_read(uint32_t at, void *to, uint16_t len) {
    uint8_t *bytes = to;
    flash_command(0x03, at);
    while (len--) *bytes++ = flash_byte(0);
    flash_select(false);
}

static uint32_t address_of(uint8_t of_page) {
    return STORE_AT + of_page * PAGE;
}

static uint32_t crc_of(const struct copy *c) {
    return slamd_crc32(0, (const uint8_t *)c, sizeof *c - 4);
}

static bool is_blank(uint8_t of_page) {
    uint8_t bytes[sizeof(struct copy)];
    flash_read(address_of(of_page), bytes, sizeof bytes);
    for (uint16_t i = 0; i < sizeof bytes; i++) {
        if (bytes[i] != 0xFF) return false;
    }
    return true;
}

void slamd_rp2040_begin_flash(void) {
    struct copy found;
    bool known = false;
    SSI_ENABLE = 0;
    SSI_BAUDR = 8;
    SSI_CTRLR0 = 7UL << 16; /* frames of 8 bits, each sent and received */
    SSI_SER = 1;
    SSI_ENABLE = 1;
    flash_command(0x4B, 0);
    flash_byte(0);
    for (uint8_t i = 0; i < 8; i++) uid[i] = flash_byte(0);
    flash_select(false);
    for (uint8_t i = 0; i < 96; i++) copy.bytes[i] = 0xFF;
    page = 2 * PAGES - 1; /* the next one is the first of a sector, and erased */
    for (uint8_t i = 0; i < 2 * PAGES; i++) {
        flash_read(address_of(i), &found, sizeof found);
        if (found.magic != MAGIC || found.crc != crc_of(&found)) continue;
        if (known && (int32_t)(found.number - copy.number) < 0) continue;
        known = true;
        copy = found;
        page = i;
    }
}

/* Goes on to the next page, erased if it is the first of its sector. */
static void begin_store(void) {
    do page = (page + 1) % (2 * PAGES);
    while (page % PAGES && !is_blank(page));
    copy.magic = MAGIC;
    copy.number++;
    copy.crc = crc_of(&copy);
    changed = false;
    storing = ERASING;
    if (page % PAGES) return;
    flash_write_enable();
    flash_command(0x20, address_of(page));
    flash_select(false);
}

/* Nothing waits for the flash: the firmware runs from the RAM. */
void slamd_rp2040_keep_settings(void) {
    struct copy written;
    if (storing == IDLE) {
        if (changed && TIMER_NOW - changed_us >= SETTLE_US) begin_store();
        return;
    }
    if (flash_is_busy()) return;
    if (storing == ERASING) {
        copy.crc = crc_of(&copy); /* a byte may have changed since */
        flash_write_enable();
        flash_command(0x02, address_of(page));
        for (uint16_t i = 0; i < sizeof copy; i++) flash_byte(((const uint8_t *)&copy)[i]);
        flash_select(false);
        storing = WRITING;
        return;
    }
    flash_read(address_of(page), &written, sizeof written);
    storing = IDLE;
    if (written.magic == MAGIC && written.number == copy.number && written.crc == crc_of(&written)) {
        tries = 0;
    } else if (++tries < TRIES) {
        changed = true;
    }
}

uint8_t slamd_port_load(uint8_t at) {
    return copy.bytes[at];
}

bool slamd_port_store(uint8_t at, uint8_t byte) {
    if (copy.bytes[at] == byte) return true;
    copy.bytes[at] = byte;
    changed = true;
    changed_us = TIMER_NOW;
    return true;
}

/* The flash's. */
void slamd_port_uid(uint8_t to[8]) {
    for (uint8_t i = 0; i < 8; i++) to[i] = uid[i];
}

#endif
