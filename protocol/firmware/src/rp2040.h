/* Registers of the RP2040, as its data sheet names and numbers them. SPDX-License-Identifier: MIT OR Apache-2.0 */
#ifndef SLAMD_RP2040_H
#define SLAMD_RP2040_H

#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(address))
#define SET 0x2000   /* a write to these aliases of a register sets or clears bits */
#define CLEAR 0x3000

#define RESETS 0x4000C000
#define PSM_WDSEL REG(0x40010008)
#define CLK_REF_CTRL REG(0x40008030)
#define CLK_REF_SELECTED REG(0x40008038)
#define CLK_SYS_CTRL REG(0x4000803C)
#define CLK_SYS_SELECTED REG(0x40008044)
#define CLK_PERI_CTRL REG(0x40008048)
#define XOSC_CTRL REG(0x40024000)
#define XOSC_STATUS REG(0x40024004)
#define XOSC_STARTUP REG(0x4002400C)
#define PLL_CS REG(0x40028000)
#define PLL_PWR 0x40028004
#define PLL_FBDIV REG(0x40028008)
#define PLL_PRIM REG(0x4002800C)
#define TIMER_NOW REG(0x40054028)
#define WATCHDOG_CTRL REG(0x40058000)
#define WATCHDOG_LOAD REG(0x40058004)
#define WATCHDOG_TICK REG(0x4005802C)
#define FUNCTION(pin) REG(0x40014004 + 8 * (pin))
#define EDGES_SEEN(pin) REG(0x400140F0 + 4 * ((pin) / 8))
#define EDGES_WANTED(pin) (0x40014100 + 4 * ((pin) / 8))
#define PAD(pin) REG(0x4001C004 + 4 * (pin))
#define PINS_IN REG(0xD0000004)
#define PINS_SET REG(0xD0000014)
#define PINS_CLEAR REG(0xD0000018)
#define PINS_TOGGLE REG(0xD000001C)
#define OUTPUTS_SET REG(0xD0000024)
#define OUTPUTS_CLEAR REG(0xD0000028)
#define UART_DATA REG(0x40034000)
#define UART_FLAGS REG(0x40034018)
#define UART_IBRD REG(0x40034024)
#define UART_FBRD REG(0x40034028)
#define UART_LCR REG(0x4003402C)
#define UART_CTRL REG(0x40034030)
#define UART_WANTED REG(0x40034038)
#define PWM_CSR REG(0x40050014) /* slice 1: A is pin 18, B pin 19 */
#define PWM_DIV REG(0x40050018)
#define PWM_CC REG(0x40050020)
#define PWM_TOP REG(0x40050024)
#define FLASH_SELECT REG(0x4001800C)
#define SSI_CTRLR0 REG(0x18000000)
#define SSI_ENABLE REG(0x18000008)
#define SSI_SER REG(0x18000010)
#define SSI_BAUDR REG(0x18000014)
#define SSI_STATUS REG(0x18000028)
#define SSI_DATA REG(0x18000060)
#define SYST_CSR REG(0xE000E010)
#define SYST_RVR REG(0xE000E014)
#define SYST_CVR REG(0xE000E018)
#define NVIC_ENABLE REG(0xE000E100)
#define NVIC_PRIORITY(irq) REG(0xE000E400 + ((irq) & ~3))

void slamd_rp2040_begin_flash(void);
void slamd_rp2040_keep_settings(void); /* call often: goes on with what is to be written */

#endif
