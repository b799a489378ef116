/* Runs the board's firmware in an emulated Raspberry Pi Pico, with sonars, two encoders and two motor bridges on its pins.
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Speaks what runner.c speaks, in lock-step, a line each way every millisecond of the emulated time and whenever sonars are
 * triggered:
 *   out: TIME_US SENT_HEX|- LEFT RIGHT [LINES]
 *   in:  LEFT_TICKS RIGHT_TICKS TO_BOARD_HEX|- {SENSOR:RISE_US:FALL_US}
 * "reset" instead of an answer is a power cut; "hang" stops the firmware with its interrupts off. Nothing depends on the wall
 * clock, so equal answers make equal runs.
 *
 * rp2040js emulates the chip; here is what it leaves out: the steps of the boot ROM, the flash's commands, and the time that a
 * byte takes on the UART. What the image touches and nobody emulates ends the run, and so does a byte that it loses. */
import { readFileSync, readSync, writeSync } from 'node:fs';
import { RP2040 } from 'rp2040js';

const TICK_US = 1000;
const STEP_US = 125; // at most one encoder edge and one received byte
const ENCODERS = [[2, 3], [4, 5]];
const TRIGGERS = [6, 7, 8, 9];
const ECHOES = [10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 26, 27, 28];
const BRIDGES = [[18, 20, 21], [19, 22, 26]]; // enable, input 1, input 2
const EMERGENCY = 27;
const RAM = 0x20000000;
const BOOT2 = 0x20041f00;
const SECTOR = 4096;

function fail(words) {
    writeSync(2, `runner: ${words}\n`);
    process.exit(70);
}

/* A serial flash: W25Q16, as far as its data sheet's commands are needed. It is what the SSI and its chip select lead to. */
class Flash {
    static ERASE_NS = 45e6;
    static PROGRAM_NS = 7e5;

    constructor(image) {
        this.bytes = image;
        this.writable = false;
        this.work = null; // {command, at, bytes, doneNs}
        this.command = [];
        this.selected = false;
        this.registers = new Map();
        this.answers = [];
        this.xip = this.hasServedReads = false;
    }

    /* A new chip is connected: the power was off. What was being written is half written. */
    connect(chip) {
        if (this.work) this.write(this.work, this.work.command === 0x20 ? SECTOR / 2 : this.work.bytes.length / 2);
        this.work = null;
        this.writable = this.selected = this.xip = false;
        this.chip = chip;
        chip.flash.set(this.bytes);
        const part = (read, write) => ({
            readUint32: read,
            writeUint32: write,
            writeUint32Atomic: (offset, value, how) => (how ? fail('atomic access to the flash') : write(offset, value)),
        });
        chip.peripherals[0x18000] = part((offset) => this.read(offset), (offset, value) => this.set(offset, value));
        chip.peripherals[0x40018] = part(() => 0, (offset, value) => {
            if (offset !== 0x0c) fail(`QSPI pin register ${offset.toString(16)}`);
            this.select((value >>> 8 & 3) === 2);
        });
    }

    read(offset) {
        if (offset === 0x28) return 6 | (this.answers.length ? 8 : 0);
        if (offset === 0x60) return this.answers.length ? this.answers.shift() : fail('nothing came from the flash');
        return this.registers.get(offset) ?? 0;
    }

    set(offset, value) {
        if (offset !== 0x60) {
            this.registers.set(offset, value);
            const mode = this.registers.get(0) ?? 0;
            this.xip = mode === (31 << 16 | 3 << 8) && this.registers.get(0xf4) === (3 << 24 | 2 << 8 | 6 << 2) &&
                this.registers.get(8) === 1;
            this.hasServedReads ||= this.xip;
            return;
        }
        if (this.registers.get(0) !== 7 << 16 || !this.selected) fail('a byte for a flash that does not listen');
        this.answers.push(this.exchange(value & 0xff));
    }

    isBusy() {
        if (this.work && this.chip.clock.nanos >= this.work.doneNs) {
            this.write(this.work, Infinity);
            this.work = null;
        }
        return this.work !== null;
    }

    exchange(byte) {
        const at = this.command.push(byte) - 1;
        const [command] = this.command;
        if (at === 0) return 0xff;
        if (command === 0x05) return (this.isBusy() ? 1 : 0) | (this.writable ? 2 : 0);
        if (this.isBusy()) return 0xff;
        if (command === 0x03 && at >= 4) return this.bytes[this.address() + at - 4];
        if (command === 0x4b && at >= 5) return 0xe0 + at;
        return 0xff;
    }

    address() {
        return this.command[1] << 16 | this.command[2] << 8 | this.command[3];
    }

    select(selected) {
        if (this.selected && !selected) this.finish();
        if (selected) this.command = [];
        this.selected = selected;
    }

    finish() {
        const [command] = this.command;
        const now = this.chip.clock.nanos;
        if (command === undefined || this.isBusy()) return;
        if (![0x02, 0x03, 0x05, 0x06, 0x20, 0x4b].includes(command)) fail(`flash command ${command.toString(16)}`);
        if (command === 0x06) this.writable = true;
        if (command !== 0x02 && command !== 0x20) return;
        if (!this.writable) fail('a write that was not enabled');
        const time = command === 0x20 ? Flash.ERASE_NS : Flash.PROGRAM_NS;
        this.work = { command, at: this.address(), bytes: this.command.slice(4), doneNs: now + time };
        this.writable = false;
    }

    write({ command, at, bytes }, part) {
        if (command === 0x20) this.bytes.fill(0xff, at & ~(SECTOR - 1), (at & ~(SECTOR - 1)) + Math.min(part, SECTOR));
        else bytes.slice(0, part).forEach((byte, i) => (this.bytes[(at & ~255) | (at + i & 255)] &= byte));
    }
}

/* UART 0 without FIFOs: a byte in the shift register, one behind it, each in its time. */
class Line {
    constructor(chip) {
        const uart = chip.uart[0];
        this.sent = [];
        this.shifting = this.held = null;
        this.primed = false;
        this.uart = uart;
        const alarm = chip.clock.createAlarm(() => {
            this.sent.push(this.shifting);
            this.shifting = this.held;
            this.held = null;
            if (this.shifting !== null) alarm.schedule(this.byteNs());
            uart.checkInterrupts();
        });
        uart.onByte = (byte) => {
            this.primed = true;
            if (this.shifting === null) {
                this.shifting = byte;
                alarm.schedule(this.byteNs());
            } else if (this.held === null) {
                this.held = byte;
            } else {
                fail('the image overwrites a byte that waits to be sent');
            }
            uart.checkInterrupts();
        };
        Object.defineProperty(uart, 'flags', {
            get: () => (uart.rxFIFO.empty ? 0x10 : 0x40) | (this.held === null ? 0x80 : 0x20),
        });
        uart.checkInterrupts = () => {
            if (this.primed && this.held === null) uart.interruptStatus |= 0x20;
            else uart.interruptStatus &= ~0x20;
            chip.setInterrupt(uart.irq, (uart.interruptStatus & uart.interruptMask) !== 0);
        };
    }

    byteNs() {
        return 1e10 / this.uart.baudRate;
    }

    receive(byte) {
        if (!this.uart.rxEnabled || !this.uart.enabled) return;
        if (this.uart.fifosEnabled || Math.abs(this.uart.baudRate - 115200) > 1000) fail('the UART is set otherwise');
        if (!this.uart.rxFIFO.empty) fail('the image was too slow: a received byte is lost');
        this.uart.feedByte(byte);
    }
}

class Board {
    constructor(uf2, sensors) {
        this.sensors = sensors;
        this.hasBridges = sensors <= 8;
        this.flash = new Flash(flashOf(uf2));
        this.beginNs = 0; // world time of the chip's time 0
        this.levels = new Map(); // of the input pins
        this.bridgeLevels = [[1, 0, 0], [1, 0, 0]]; // resistors
        this.isOutput = [false, false];
        this.driven = [0, 0];
        this.drivenSince = [0, 0];
        this.readAt = 0;
        this.rising = this.trigger = 0;
        this.ticks = [0, 0];
        this.wanted = [0, 0];
        this.toBoard = [];
        this.echoes = []; // {at: ns, pin, level}, sorted
        this.stepAt = 0;
        this.boot();
    }

    now() {
        return this.beginNs + this.chip.clock.nanosCounter;
    }

    /* What the boot ROM does: the checksum of the second stage, and the jump to it. */
    boot() {
        if (this.chip) this.beginNs = this.now();
        const chip = new RP2040();
        const complain = (part, words) => fail(`${part}: ${words}`);
        chip.logger = { debug() {}, info() {}, warn: complain, error: complain };
        this.chip = chip;
        this.flash.connect(chip);
        this.line = new Line(chip);
        const stage = this.flash.bytes.subarray(0, 256);
        const sum = new DataView(stage.buffer, stage.byteOffset, 256).getUint32(252, true);
        if (crc32(stage.subarray(0, 252)) !== sum) fail("the second stage's checksum is wrong");
        chip.sram.set(stage, BOOT2 - RAM);
        chip.core.SP = BOOT2;
        chip.core.LR = 0;
        chip.core.PC = BOOT2;
        this.cycleNs = 1e9 / chip.clkSys;
        chip.addClockListener((hz) => (this.cycleNs = 1e9 / hz));
        chip.onBreak = () => fail('breakpoint');
        const watchdog = chip.peripherals[0x40058];
        watchdog.onWatchdogTrigger = () => {
            watchdog.alarm.enable = false;
            this.resets = true;
        };
        this.resets = false;
        for (const [pin, level] of this.levels) chip.gpio[pin].setInputValue(level);
        TRIGGERS.forEach((pin, line) => chip.gpio[pin].addListener((state) => this.onTrigger(line, state)));
        if (!this.hasBridges) return;
        BRIDGES.forEach((pins, wheel) => {
            this.integrate(wheel);
            this.bridgeLevels[wheel] = [1, 0, 0];
            this.isOutput[wheel] = false;
            pins.forEach((pin, i) => chip.gpio[pin].addListener((state) => this.onBridge(wheel, i, state)));
        });
    }

    /* A sonar begins to sing when its trigger falls. */
    onTrigger(line, state) {
        if (state === 1) {
            this.rising |= 1 << line;
        } else if (TRIGGERS.every((pin) => this.chip.gpio[pin].value !== 1)) {
            this.trigger = this.rising;
            this.rising = 0;
        }
    }

    integrate(wheel) {
        const [enable, first, second] = this.bridgeLevels[wheel];
        const now = this.now();
        this.driven[wheel] += enable * (first - second) * (now - this.drivenSince[wheel]);
        this.drivenSince[wheel] = now;
    }

    onBridge(wheel, i, state) {
        this.integrate(wheel);
        const isOutput = state <= 1;
        if (i === 0) this.isOutput[wheel] = isOutput;
        this.bridgeLevels[wheel][i] = isOutput ? state : i === 0 ? 1 : 0;
    }

    bridge(wheel) {
        const [enable, first, second] = this.bridgeLevels[wheel];
        const elapsed = this.now() - this.readAt;
        this.integrate(wheel);
        const driven = this.driven[wheel];
        this.driven[wheel] = 0;
        if (!this.isOutput[wheel] || (enable && !first && !second && driven === 0)) return 'brake';
        return elapsed ? Math.trunc((1000 * driven) / elapsed) : 0;
    }

    set(pin, level) {
        if (this.levels.get(pin) === level) return;
        this.levels.set(pin, level);
        this.chip.gpio[pin].setInputValue(level);
    }

    step() {
        ENCODERS.forEach((pins, wheel) => {
            if (this.ticks[wheel] === this.wanted[wheel]) return;
            this.ticks[wheel] += this.ticks[wheel] < this.wanted[wheel] ? 1 : -1;
            const gray = [0, 1, 3, 2][this.ticks[wheel] & 3]; // bit 0 is A: A leads
            pins.forEach((pin, i) => this.set(pin, (gray >> i & 1) === 1));
        });
        if (this.toBoard.length) this.line.receive(this.toBoard.shift());
    }

    /* Until a time of the world, or until sonars are triggered. */
    runUntil(end) {
        while (this.now() < end && !this.trigger) {
            let limit = Math.min(end, this.stepAt);
            if (this.echoes.length) limit = Math.min(limit, this.echoes[0].at);
            this.execute(limit - this.beginNs);
            if (this.resets) this.boot();
            while (this.echoes.length && this.echoes[0].at <= this.now()) {
                const { pin, level } = this.echoes.shift();
                this.set(pin, level);
            }
            if (this.now() >= this.stepAt) {
                this.step();
                this.stepAt += STEP_US * 1000;
            }
        }
    }

    execute(limit) {
        const { core, clock } = this.chip;
        while (clock.nanosCounter < limit && !this.trigger && !this.resets) {
            const next = clock.nextAlarm;
            if (core.waiting && !core.interruptsUpdated) {
                clock.tick((next && next.nanos < limit ? next.nanos : limit) - clock.nanosCounter);
                continue;
            }
            const ns = core.executeInstruction() * this.cycleNs;
            const alarm = clock.nextAlarm;
            if (alarm && alarm.nanos <= clock.nanosCounter + ns) clock.tick(ns);
            else clock.nanosCounter += ns;
        }
        if (core.PC >>> 0 < RAM) fail(`runs at ${core.PC.toString(16)}, not in the RAM`);
        if (core.PC >>> 0 < BOOT2 && !this.flash.hasServedReads) fail('the second stage did not set the flash to serial reads');
    }

    hang() {
        const { core } = this.chip;
        this.chip.sramView.setUint16(BOOT2 - RAM, 0xe7fe, true); // b .
        core.PM = true;
        core.waiting = false;
        core.PC = BOOT2;
    }

    pulse(word) {
        const [sensor, riseUs, fallUs] = word.split(':').map(Number);
        if (!(sensor < this.sensors)) return;
        const pin = ECHOES[sensor];
        this.echoes = this.echoes.filter((edge) => edge.pin !== pin);
        this.echoes.push({ at: riseUs * 1000, pin, level: true }, { at: fallUs * 1000, pin, level: false });
        this.echoes.sort((a, b) => a.at - b.at);
    }

    /* Returns false at the end. */
    answer(line) {
        if (!line) return false;
        const [left, right, bytes, ...pulses] = line.split(' ');
        if (left === 'reset' || left === 'hang') {
            if (left === 'reset') this.boot();
            else this.hang();
            return true;
        }
        if (this.hasBridges) this.set(EMERGENCY, left.endsWith('!'));
        this.wanted = [parseInt(left, 10), parseInt(right, 10)];
        if (bytes !== '-') this.toBoard.push(...Buffer.from(bytes, 'hex'));
        pulses.forEach((word) => this.pulse(word));
        return true;
    }
}

/* CRC-32/MPEG-2. */
function crc32(bytes) {
    let crc = 0xffffffff;
    for (const byte of bytes) {
        crc ^= byte << 24;
        for (let i = 0; i < 8; i++) crc = crc < 0 ? (crc << 1) ^ 0x04c11db7 : crc << 1;
    }
    return crc >>> 0;
}

/* What is in the flash after the file was copied to the boot ROM's drive. */
function flashOf(uf2) {
    const flash = new Uint8Array(2 * 1024 * 1024).fill(0xff);
    const view = new DataView(uf2.buffer, uf2.byteOffset, uf2.length);
    if (uf2.length === 0 || uf2.length % 512) fail('no UF2 file');
    for (let at = 0; at < uf2.length; at += 512) {
        const words = [0, 4, 8, 16, 24, 28, 508].map((offset) => view.getUint32(at + offset, true));
        const good = [0x0a324655, 0x9e5d5157, 0x2000, 256, uf2.length / 512, 0xe48bff56, 0x0ab16f30];
        if (words.some((word, i) => word !== good[i])) fail(`block ${at / 512} is none of an RP2040's UF2`);
        flash.set(uf2.subarray(at + 32, at + 288), view.getUint32(at + 12, true) - 0x10000000);
    }
    return flash;
}

let rest = '';
const chunk = Buffer.alloc(65536);
function readLine() {
    for (;;) {
        const end = rest.indexOf('\n');
        if (end >= 0) {
            const line = rest.slice(0, end);
            rest = rest.slice(end + 1);
            return line;
        }
        const len = readSync(0, chunk);
        if (len === 0) return '';
        rest += chunk.toString('latin1', 0, len);
    }
}

const [image, sensors] = process.argv.slice(2);
if (!image) {
    writeSync(2, 'usage: runner_pico.mjs IMAGE.uf2 [SENSORS]\n');
    process.exit(64);
}
const board = new Board(readFileSync(image), Number(sensors ?? 16));
for (let tick = TICK_US; ; ) {
    board.runUntil(tick * 1000);
    const us = board.trigger ? Math.floor(board.now() / 1000) : tick;
    const sent = board.line.sent.length ? Buffer.from(board.line.sent).toString('hex') : '-';
    const lines = board.trigger ? ` ${board.trigger}` : '';
    const out = `${us} ${sent} ${board.bridge(0)} ${board.bridge(1)}${lines}\n`;
    if (!board.trigger) tick += TICK_US;
    board.readAt = board.now();
    board.line.sent = [];
    board.trigger = 0;
    writeSync(1, out);
    if (!board.answer(readLine())) break;
}
