"""Processor and registers of a board around its linked image, driven line by line: a test's process of its own.

    processor.py IMAGE BOARD

It has what the image touches and nothing that judges: oscillators and PLL as ready flags, reset causes, watchdog, supply detector,
cycle counter, converters, bus, pins, the timer that triggers and latches, the interrupt's enable bit, the Ethernet's rings of descriptors,
and the debugger's view of memory; outside of the chip the two registers of the outputs' converters, whose first a readback answers. Every answer is a line. Time is counted in cycles of
the processor at its full clock; two instructions take three of its own.
"""

import collections
import dataclasses
import random
import struct
import sys

import unicorn
from elftools.elf.elffile import ELFFile
from unicorn import arm_const as arm

# So many slices in a row that do nothing but read one register are a wait for what does not come: from there on a slice stands for
# TIMES as many. Waits that the image itself bounds are shorter.
WAITING, TIMES = 2000, 20
# Instructions of main between two looks at watchdog and clock: 1.8 us at 170 MHz.
SLICE = 200
LSI_HZ = 32_000
# Position of ADC1 and ADC2 in the vector table, behind the 16 exceptions (RM0433 and RM0440).
POSITION = 18
NVIC_ISER0, VTOR = 0xE000E100, 0xE000ED08
DEMCR, DWT_CTRL, DWT_CYCCNT, DWT_LAR = 0xE000EDFC, 0xE0001000, 0xE0001004, 0xE0001FB0
TIM3 = 0x40000400
SPI1 = 0x40013000
# The MAC's DMA, the station's address and data (RM0433, "ETH registers"); descriptors' bits: owned by the DMA, first, last, valid buffer.
DMA, STATION = 0x40029000, 0x40028200
OWN, FIRST, LAST = 1 << 31, 1 << 29, 1 << 28
# Frames that wait for whoever is on the cable.
ON_THE_CABLE = 64
# Commands of the outputs' converters.
WRITE, WRITE_AND_UPDATE, READ_BACK, NO_OPERATION = 0b0001, 0b0011, 0b0101, 0b0000
# Pin of LDAC, which is pulled low outside, and its alternate function that is the timer's first channel.
LDAC, CHANNEL = 4, 2


@dataclasses.dataclass(frozen=True)
class Board:
    """What differs from board to board; addresses of RM0440 and RM0433."""

    cpu: int
    mode: int
    memories: tuple
    processor_hz: int
    # Of the oscillator that a reset starts, which the processor runs on until it is switched to the PLL.
    internal_hz: int
    # Of the timer, in one of the processor's.
    timer_cycles: int
    adcs: tuple
    adc_common: int
    adc_shift: int
    # Of a converter that waits to be written to: the port, and each axis' pin.
    syncs: tuple
    fault: tuple
    button: tuple
    watchdog: int
    # Where the cause of a reset is, its clear bit, and the flags of each cause.
    cause: int
    forget: int
    causes: dict
    # Supply below its level.
    supply: tuple
    # Options: their place; the highest brown-out level, and two banks of flash.
    options: tuple
    # The bus: enable bit of CR1; status register, data out, data in.
    spi: tuple
    # Where the converters' answers come in: the port, and the pin.
    miso: tuple
    # LDAC's port.
    ldac: int
    # Bits that follow others: (register, the one written, the one that says that it is so); the PLL, the outer clock.
    ready: tuple
    pll: tuple
    outer: tuple
    # Switch of the system's clock: register, mask, shift. The PLL is 3 on both boards.
    switch: tuple
    # Bits that are always set.
    always: tuple


G474 = Board(
    cpu=arm.UC_CPU_ARM_CORTEX_M4,
    mode=unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS,
    memories=((0x08000000, 0x80000), (0x10000000, 0x8000), (0x20000000, 0x18000), (0x1FFF0000, 0x10000)),
    processor_hz=170_000_000,
    internal_hz=16_000_000,
    timer_cycles=1,
    adcs=(0x50000000, 0x50000100),
    adc_common=0x50000308,
    adc_shift=4,
    syncs=((0x48000400, 6),),
    fault=(0x48000800, 7),
    button=(0x48000800, 13),
    watchdog=0x40003000,
    cause=0x40021094,
    forget=1 << 23,
    causes={"power": 1 << 27 | 1 << 26, "brown-out": 1 << 27 | 1 << 26, "watchdog": 1 << 29 | 1 << 26, "pin": 1 << 26},
    supply=(0x40007014, 11),
    options=(0x40022020, 0b100 << 8 | 1 << 22),
    spi=(1 << 6, 0x08, 0x0C, 0x0C),
    miso=(0x48000000, 6),
    ldac=0x48000400,
    ready=((0x40021000, 8, 10), (0x40021094, 0, 1), (0x40021098, 0, 1), (0x40021090, 0, 1)),
    pll=(0x40021000, 24, 25),
    outer=(0x40021000, 16, 17),
    switch=(0x40021008, 0b11, 2),
    always=(),
)

H743 = Board(
    # unicorn's Cortex-M7 has no double precision, which main takes for some constants. This one has every instruction of the images.
    cpu=arm.UC_CPU_ARM_MAX,
    mode=unicorn.UC_MODE_THUMB,
    memories=((0x08000000, 0x200000), (0x00000000, 0x10000), (0x20000000, 0x20000), (0x24000000, 0x80000), (0x1FF00000, 0x100000)),
    processor_hz=400_000_000,
    internal_hz=64_000_000,
    timer_cycles=2,
    adcs=(0x40022000, 0x40022100),
    adc_common=0x40022308,
    adc_shift=0,
    syncs=((0x58020C00, 14), (0x58020C00, 15)),
    fault=(0x58020400, 14),
    button=(0x58020800, 13),
    watchdog=0x58004800,
    cause=0x580244D0,
    forget=1 << 16,
    causes={
        "power": 1 << 23 | 1 << 22 | 1 << 21,
        "brown-out": 1 << 22 | 1 << 21,
        "watchdog": 1 << 26 | 1 << 22,
        "pin": 1 << 22,
    },
    supply=(0x58024804, 4),
    options=(0x5200201C, 0b11 << 2),
    spi=(1 << 0, 0x14, 0x20, 0x30),
    miso=(0x58020000, 6),
    ldac=0x58020400,
    ready=(
        (0x58024400, 0, 2),
        (0x58024400, 7, 8),
        (0x58024400, 12, 13),
        (0x58024474, 0, 1),
        (0x58024470, 0, 1),
    ),
    pll=(0x58024400, 24, 25),
    outer=(0x58024400, 16, 17),
    switch=(0x58024410, 0b111, 3),
    # The oscillator of a reset, domain clocks, regulator and voltage scale.
    always=((0x58024400, 1 | 1 << 2 | 1 << 14 | 1 << 15), (0x58024804, 1 << 13), (0x58024818, 1 << 13)),
)

BOARDS = {"nucleo-g474re": G474, "nucleo-h743zi": H743}


class Processor:
    """One board with one image in its flash."""

    def __init__(self, image, board, table=None):
        """`table` is a file of what an upload has left in the first slot; without it both are erased."""
        self.board = board
        self._connect()
        self.uc = unicorn.Uc(unicorn.UC_ARCH_ARM, board.mode)
        self.uc.ctl_set_cpu_model(board.cpu)
        for start, size in board.memories:
            self.uc.mem_map(start, size)
        # The flash's last words, where no image reaches: a handler that returns there has ended, and a branch to itself.
        flash, size = board.memories[0]
        self.ended, self.forever = flash + size - 16, flash + size - 8
        # As it is delivered.
        self.uc.mem_write(flash, b"\xff" * size)
        with open(image, "rb") as file:
            elf = ELFFile(file)
            for segment in elf.iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                    self.uc.mem_write(segment["p_paddr"], segment.data())
            symbols = list(elf.get_section_by_name(".symtab").iter_symbols())
        self.symbols = {name: self._symbol(symbols, name) for name in ("ORDERS", "ROUNDS", "KEPT")}
        if table is not None:
            slot = next(symbol["st_value"] for symbol in symbols if symbol.name == "__slot_0")
            with open(table, "rb") as file:
                self.uc.mem_write(slot, file.read())
        self.rtt = next(symbol["st_value"] for symbol in symbols if symbol.name == "_SEGGER_RTT")
        self.uc.mmio_map(0x40000000, 0x20000000, self._read, None, self._write, None)
        self.uc.mmio_map(0xE0000000, 0x100000, self._read_core, None, self._write_core, None)
        self.inputs = {"button": 0, "low": 0, "dwt-locked": 0, "no-pll": 0, "no-outer": 0, "no-adc": 0, "no-sdo": 0, "no-ldac": 0, "no-cable": 0}
        # Outside of the chip: bytes since SYNC fell of each axis' converter, and the words that have ended.
        self.bytes = [bytearray() for _ in board.syncs]
        self.words = []
        self.axes = len(board.syncs)
        # The code that each has been told, the one that its output has, and the word that it shifts out next.
        self.told = [0] * self.axes
        self.held = [0] * self.axes
        # Outputs that have changed.
        self.changed = []
        # Frames that have left, and the next descriptor of either ring.
        self.left = collections.deque(maxlen=ON_THE_CABLE)
        self.rings = {"out": 0, "in": 0}
        self.answers = [None] * self.axes
        # Bytes that have come in.
        self.received = bytearray()
        self.cycles = 0
        # Cycles that the processor was behind its full clock.
        self.behind = 0
        self.flags = 0
        self.fresh = self.uc.context_save()
        self.reset("power")

    @staticmethod
    def _symbol(symbols, name):
        wanted = f"6nucleo{len(name)}{name}"
        return next(symbol["st_value"] for symbol in symbols if wanted in symbol.name)

    # What the outside does.

    def reset(self, cause):
        """Registers begin anew; what memory holds depends on the cause."""
        self.unwritten_read = False
        if cause in ("power", "brown-out"):
            noise = random.Random(cause)
            for start, size in self.board.memories:
                if start not in (0x08000000, 0x1FF00000, 0x1FFF0000):
                    self.uc.mem_write(start, noise.randbytes(size))
            self._watch_kept()
        self.registers = {self.board.options[0]: self.board.options[1]}
        self.core = {}
        # Flags stay until the image forgets them, or power goes.
        before = 0 if cause in ("power", "brown-out") else self.flags
        self.flags = before | self.board.causes[cause]
        self.unlocked = not self.inputs["dwt-locked"]
        self.watched_since, self.watched_for = None, 0
        self.unguarded = False
        self.codes = [0] * self.axes
        self.eoc = False
        self.late = False
        self.spun = False
        # Registers of the chip that main has touched in a slice; slices that it has waited for one of them.
        self.touched = set()
        self.waited = 0
        if cause == "power":
            self.lose_converters()
        # Nothing drives LDAC any more.
        self._latch(self.cycles)
        for pending in (*self.bytes, self.received):
            pending.clear()
        self.selected = [False] * self.axes
        self.left.clear()
        self.rings = {"out": 0, "in": 0}
        self.pins = {}
        self.bitten = False
        self.stuck = False
        self.uc.context_restore(self.fresh)
        self.uc.reg_write(arm.UC_ARM_REG_FPEXC, 0x40000000)
        stack, self.pc = struct.unpack("<II", self.uc.mem_read(0x08000000, 8))
        self.uc.reg_write(arm.UC_ARM_REG_SP, stack)

    def lose_converters(self):
        """Power of the outputs' converters comes anew."""
        self.told = [0] * self.axes
        self.held = [0] * self.axes
        self.answers = [None] * self.axes

    def _latch_at(self):
        """Cycles from a trigger to the fall of LDAC; None where the timer does not drive it."""
        get = self.registers.get
        port = self.board.ldac
        driven = get(port, 0) >> 2 * LDAC & 0b11 == 0b10 and get(port + 0x20, 0) >> 4 * LDAC & 0b1111 == CHANNEL
        # PWM mode 1, enabled, active high.
        mode = get(TIM3 + 0x18, 0)
        timed = mode & 0b11 == 0 and mode >> 4 & 0b111 == 0b110 and not mode >> 16 & 1 and get(TIM3 + 0x20, 0) & 0b11 == 1
        counts, period = get(TIM3 + 0x34, 0), get(TIM3 + 0x2C, 0) + 1
        if self.inputs["no-ldac"] or not (driven and timed and get(TIM3, 0) & 1 and 0 < counts < period):
            return None
        return counts * (get(TIM3 + 0x28, 0) + 1) * self.board.timer_cycles

    def _latch(self, at):
        """LDAC falls: every output has what its converter was told."""
        for axis, code in enumerate(self.told):
            if self.held[axis] != code:
                self.changed.append((axis, code, at))
                self.held[axis] = code

    def _watch_kept(self):
        """After power: a look at the kept words before they were written would be a fault of their check bits."""
        kept = self.symbols["KEPT"]
        hooks = []

        def read(*_):
            self.unwritten_read = True

        def written(*_):
            for hook in hooks:
                self.uc.hook_del(hook)
            hooks.clear()

        hooks.append(self.uc.hook_add(unicorn.UC_HOOK_MEM_READ, read, begin=kept, end=kept + 3))
        hooks.append(self.uc.hook_add(unicorn.UC_HOOK_MEM_WRITE, written, begin=kept, end=kept + 3))

    # Registers of the chip.

    def _read(self, _uc, offset, size, _data):
        address = 0x40000000 + offset
        place = address & ~3
        self.touched.add(place)
        self._guard(place)
        look = self.LOOKS.get(place)
        value = self.registers.get(place, 0) if look is None else look(self, self.registers.get(place, 0))
        return value >> 8 * (address & 3) & (1 << 8 * size) - 1

    def _write(self, _uc, offset, size, value, _data):
        address = 0x40000000 + offset
        place = address & ~3
        # Two, whatever is read beside it.
        self.touched.update((place, -1))
        self._guard(place)
        if size == 4:
            whole = value
        else:
            mask = (1 << 8 * size) - 1 << 8 * (address & 3)
            whole = self.registers.get(place, 0) & ~mask | value << 8 * (address & 3) & mask
        act = self.ACTS.get(place)
        if act is None:
            self.registers[place] = whole
        else:
            act(self, place, whole, size)

    def _guard(self, place):
        """The watchdog runs before anything but the reset's cause is looked at."""
        if self.watched_since is None and place not in (self.board.cause, self.board.watchdog):
            self.unguarded = True

    def _read_core(self, _uc, offset, size, _data):
        address = 0xE0000000 + offset
        self.touched.update((address, -1))
        if address == DWT_CYCCNT:
            return self._cycle_count()
        return self.core.get(address & ~3, 0) >> 8 * (address & 3) & (1 << 8 * size) - 1

    def _write_core(self, _uc, offset, size, value, _data):
        address = 0xE0000000 + offset
        if address == DWT_LAR:
            # The lock of this model never opens: the worst that is known of the part.
            return
        if address & ~0xFFF == DWT_CTRL & ~0xFFF and not self.unlocked:
            return
        if address == NVIC_ISER0:
            value |= self.core.get(address, 0)
        self.core[address & ~3] = value

    def _cycle_count(self):
        if not (self.core.get(DWT_CTRL, 0) & 1 and self.core.get(DEMCR, 0) & 1 << 24):
            return 0
        return self.cycles - self.behind & 0xFFFFFFFF

    def _feed(self):
        """The counter is loaded: what is written to the reload register counts from here on."""
        self.watched_since = self.cycles
        prescaler = self.registers.get(self.board.watchdog + 4, 0) & 0b111
        reload = self.registers.get(self.board.watchdog + 8, 0xFFF) & 0xFFF
        self.watched_for = (4 << prescaler) * (reload + 1) * self.board.processor_hz // LSI_HZ

    def _key(self, _place, value, _size):
        if value == 0xCCCC or (value == 0xAAAA and self.watched_since is not None):
            self._feed()

    def _port(self, place, value, _size):
        port = place - 0x18
        for pin in range(16):
            if value >> pin & 1:
                self._set_pin(port, pin, True)
            elif value >> pin + 16 & 1:
                self._set_pin(port, pin, False)

    def _port_low(self, place, value, _size):
        for pin in range(16):
            if value >> pin & 1:
                self._set_pin(place - 0x28, pin, False)

    def _set_pin(self, port, pin, high):
        self.pins[port, pin] = high
        if (port, pin) not in self.board.syncs:
            return
        axis = self.board.syncs.index((port, pin))
        if high and self.selected[axis] and self.bytes[axis]:
            self._told(axis, bytes(self.bytes[axis]))
        self.bytes[axis].clear()
        self.selected[axis] = not high

    def _told(self, axis, word):
        """A word has ended: a code, a question, or nothing; whatever else there is stands before the judge."""
        command, self.answers[axis] = word[0] >> 4, None
        if len(word) == 3 and command == READ_BACK:
            self.answers[axis] = (self.told[axis] << 4).to_bytes(3, "big")
            return
        if len(word) == 3 and command == NO_OPERATION:
            return
        self.words.append((axis, word))
        if len(word) != 3 or command not in (WRITE, WRITE_AND_UPDATE):
            return
        self.told[axis] = int.from_bytes(word, "big") >> 4 & 0xFFFF
        if command == WRITE_AND_UPDATE or self._latch_at() is None:
            self.changed.append((axis, self.told[axis], self.cycles))
            self.held[axis] = self.told[axis]

    def _send(self, _place, value, size):
        if not self.registers.get(SPI1, 0) & self.board.spi[0]:
            return
        for data in (value & (1 << 8 * size) - 1).to_bytes(size, "little"):
            self._receive()
            for axis in range(self.axes):
                if self.selected[axis]:
                    self.bytes[axis].append(data)

    def _receive(self):
        """A byte comes in where the pin is the bus's: a converter's answer, or what the pin is pulled to."""
        port, pin = self.board.miso
        mode, pull = (self.registers.get(port + at, 0) >> 2 * pin & 0b11 for at in (0x00, 0x0C))
        if mode != 0b10:
            return
        byte = 0xFF if pull == 0b01 else 0
        for axis in range(self.axes):
            answer, at = self.answers[axis], len(self.bytes[axis])
            if self.selected[axis] and answer and at < len(answer) and not self.inputs["no-sdo"]:
                byte = answer[at]
        self.received.append(byte)

    def _bus_data(self, _value):
        return self.received.pop(0) if self.received else 0

    def _adc_control(self, place, value, _size):
        # Calibration and disabling end at once; ADDIS takes ADEN with it.
        if value & 2:
            value &= ~3
        if not self.inputs["no-adc"]:
            value &= ~(1 << 31)
        self.registers[place] = value

    def _forget(self, place, value, _size):
        if value & self.board.forget:
            self.flags = 0
        self.registers[place] = value

    # The cable.

    def _ring_of(self, way):
        """Address and number of a ring's descriptors."""
        begin, length = {"out": (0x114, 0x12C), "in": (0x11C, 0x130)}[way]
        return self.registers.get(DMA + begin, 0), (self.registers.get(DMA + length, 0) & 0x3FF) + 1

    def _descriptor(self, way):
        """The next one of a ring: its address and words, where the DMA owns it."""
        begin, length = self._ring_of(way)
        at = begin + 16 * (self.rings[way] % length)
        words = struct.unpack("<IIII", self.uc.mem_read(at, 16)) if begin else (0,) * 4
        return (at, words) if words[3] & OWN else None

    def _done(self, way, at, status):
        self.uc.mem_write(at + 12, struct.pack("<I", status))
        self.rings[way] += 1

    def _send_frames(self, place, value, _size):
        """The tail pointer was written: what the DMA owns leaves."""
        self.registers[place] = value
        while self.registers.get(DMA + 0x104, 0) & 1 and (found := self._descriptor("out")):
            at, (buffer, _, length, status) = found
            self.left.append(bytes(self.uc.mem_read(buffer, length & 0x3FFF)))
            self._done("out", at, status & ~OWN)

    def frame(self, data):
        """A frame comes by the cable; one that finds no room is lost."""
        found = self.registers.get(DMA + 0x108, 0) & 1 and self._descriptor("in")
        if found:
            at, (buffer, *_) = found
            self.uc.mem_write(buffer, data)
            # The length counts the checksum behind it.
            self._done("in", at, FIRST | LAST | len(data) + 4)

    def frames(self):
        """Those that have left since the last look."""
        left = " ".join(frame.hex() for frame in self.left)
        self.left.clear()
        return left

    def _mac_reset(self, value):
        """It ends by the clock that the cable's other chip gives."""
        return value if self.inputs["no-cable"] else value & ~1

    # What main and the interrupt are given.

    def started(self):
        """The timer triggers the converter, whose end interrupts."""
        get = self.registers.get
        adc = self.board.adcs[0]
        triggered = get(adc + 0x0C, 0)
        return bool(
            get(TIM3, 0) & 1
            and get(TIM3 + 4, 0) >> 4 & 0b111 == 0b010
            and get(adc + 8, 0) & 0b101 == 0b101
            and triggered >> 10 & 0b11 == 0b01
            and triggered >> 5 & 0b11111 == 4
            and get(adc + 4, 0) & 1 << 2
            and self.core.get(NVIC_ISER0, 0) >> POSITION & 1
        )

    def period(self):
        """Cycles from a trigger to the next."""
        get = self.registers.get
        return (get(TIM3 + 0x28, 0) + 1) * (get(TIM3 + 0x2C, 0) + 1) * self.board.timer_cycles

    def main(self, instructions):
        """Main alone, for so many instructions, or until the loop starts or the watchdog bites."""
        while instructions > 0 and not self._bites():
            self._slice(min(SLICE, instructions))
            instructions -= SLICE
            self.waited = self.waited + 1 if len(self.touched) == 1 else 0
            if self.waited > WAITING:
                self._spend((TIMES - 1) * SLICE)
            self.touched.clear()
            if self.started():
                break
        return self._answer()

    def tick(self, codes, instructions, late):
        """A period: conversion, interrupt, and main for so many instructions."""
        begun = self.cycles
        period = self.period()
        orders = int.from_bytes(self.uc.mem_read(self.symbols["ORDERS"], 2), "little")
        rounds = int.from_bytes(self.uc.mem_read(self.symbols["ROUNDS"], 4), "little")
        latch = self._latch_at()
        # Words are there before it, but for those of a tick that the next conversion overtakes.
        if latch is not None and late:
            self._latch(begun + latch)
        if self.started() and codes:
            self.codes = [code >> self.board.adc_shift for code in codes]
            self.eoc, self.late = True, late
            self._interrupt()
        if latch is not None and not late:
            self._latch(begun + latch)
        self.cycles = begun + period // 2
        if instructions and not self.spun:
            self._slice(instructions)
        self.cycles = begun + period
        self._bites()
        return f"{orders} {rounds} {self._answer()}"

    def _slice(self, instructions):
        if not self.stuck:
            try:
                self.uc.emu_start(self.pc | 1, self.ended, count=instructions)
                self.pc = self.uc.reg_read(arm.UC_ARM_REG_PC)
            except unicorn.UcError:
                # A hard fault's handler does not come back.
                self.stuck = True
        self._spend(instructions)

    def _spend(self, instructions):
        """Time goes by, more of it on the slower clock."""
        own = took = 3 * instructions // 2
        switch, mask, _ = self.board.switch
        if self.registers.get(switch, 0) & mask != 3:
            took = own * self.board.processor_hz // self.board.internal_hz
        self.cycles += took
        self.behind += took - own

    def _interrupt(self):
        if self.stuck or self.spun:
            return
        saved = self.uc.context_save()
        table = self.core.get(VTOR, 0x08000000)
        handler = int.from_bytes(self.uc.mem_read(table + 4 * (16 + POSITION), 4), "little")
        # Below main's, behind the exception's frame.
        self.uc.reg_write(arm.UC_ARM_REG_SP, self.uc.reg_read(arm.UC_ARM_REG_SP) - 0x68 & ~7)
        self.uc.reg_write(arm.UC_ARM_REG_LR, self.ended | 1)
        try:
            # No interrupt of these takes as many; one that hangs does.
            self.uc.emu_start(handler | 1, self.ended, count=20_000)
            self.spun = self.uc.reg_read(arm.UC_ARM_REG_PC) != self.ended
        except unicorn.UcError:
            self.stuck = True
        self.uc.context_restore(saved)

    def _bites(self):
        if self.watched_since is not None:
            self.bitten = self.bitten or self.cycles - self.watched_since > self.watched_for
        return self.bitten

    def hang(self, what):
        """A branch to itself: where main is, or at the handler's beginning."""
        if what == "main":
            self.pc = at = self.forever
        elif what == "interrupt":
            at = int.from_bytes(self.uc.mem_read(0x08000000 + 4 * (16 + POSITION), 4), "little") & ~1
        else:
            # A jump to where nothing is.
            self.pc = 0x60000000
            return
        self.uc.mem_write(at, b"\xfe\xe7")
        self.uc.ctl_remove_cache(at, at + 2)

    def _answer(self):
        state = "bitten" if self.bitten else "loop" if self.started() else "start"
        words = [f"{axis}:{word.hex()}" for axis, word in self.words]
        changed = [f"{axis}={code}@{at}" for axis, code, at in self.changed]
        self.words.clear()
        self.changed.clear()
        fault = int(self.pins.get(self.board.fault, False))
        flags = f"{fault} {int(self.unwritten_read)} {int(self.unguarded)}"
        return " ".join((f"{self.cycles} {state} {flags}", *words, *changed))

    # The debugger's view.

    def _ring(self, up, channel):
        ups = int.from_bytes(self.uc.mem_read(self.rtt + 16, 4), "little")
        return self.rtt + 24 + 24 * (channel if up else ups + channel)

    def telemetry(self):
        """What main has written to channel 1 since the last look."""
        at = self._ring(True, 1)
        buffer, size, written, read = struct.unpack("<IIII", self.uc.mem_read(at + 4, 16))
        if read <= written:
            data = self.uc.mem_read(buffer + read, written - read) if written > read else b""
        else:
            data = self.uc.mem_read(buffer + read, size - read) + self.uc.mem_read(buffer, written)
        self.uc.mem_write(at + 16, struct.pack("<I", written))
        return bytes(data).hex()

    def orders(self, data):
        """Bytes for main on channel 1."""
        at = self._ring(False, 1)
        buffer, size, written = struct.unpack("<III", self.uc.mem_read(at + 4, 12))
        for byte in data:
            self.uc.mem_write(buffer + written, bytes([byte]))
            written = (written + 1) % size
        self.uc.mem_write(at + 12, struct.pack("<I", written))

    def _connect(self):
        """What reads and writes of an address do beside keeping a value."""
        board, self.LOOKS, self.ACTS = self.board, {}, {}

        def bits(place):
            follows = [(on, is_on, None) for at, on, is_on in board.ready if at == place]
            for (at, on, is_on), absent in ((board.pll, "no-pll"), (board.outer, "no-outer")):
                if at == place:
                    follows.append((on, is_on, absent))
            # The two other PLLs of the one board, as the first.
            if place == board.pll[0] and board is H743:
                follows += [(26, 27, "no-pll"), (28, 29, "no-pll")]
            always = sum(value for at, value in board.always if at == place)

            def look(self, value):
                for on, is_on, absent in follows:
                    # Read alone, whatever was written there.
                    value &= ~(1 << is_on)
                    if value >> on & 1 and not (absent and self.inputs[absent]):
                        value |= 1 << is_on
                return value | always

            return look

        for place in {at for at, *_ in (*board.ready, board.pll, board.outer, *board.always)}:
            self.LOOKS[place] = bits(place)
        switch, mask, shift = board.switch
        self.LOOKS[switch] = lambda self, value: value & ~(mask << shift) | (value & mask) << shift
        before = self.LOOKS.get(board.cause, lambda self, value: value)
        self.LOOKS[board.cause] = lambda self, value: before(self, value) & 0x00FFFFFF & ~board.forget | self.flags
        self.ACTS[board.cause] = Processor._forget
        supply, bit = board.supply
        steady = self.LOOKS.get(supply, lambda self, value: value)
        self.LOOKS[supply] = lambda self, value: steady(self, value) | self.inputs["low"] << bit
        for number, adc in enumerate(board.adcs):
            self._connect_adc(number, adc)
        self.LOOKS[board.button[0] + 0x10] = lambda self, value: self.inputs["button"] << board.button[1]
        # Always room, never busy, every transfer complete.
        free = 0b10 if board is G474 else 1 << 1 | 1 << 3 | 1 << 12
        self.LOOKS[SPI1 + board.spi[1]] = lambda self, value: free | bool(self.received)
        self.LOOKS[SPI1 + board.spi[3]] = Processor._bus_data
        self.ACTS[SPI1 + board.spi[2]] = Processor._send
        self.ACTS[board.watchdog] = Processor._key
        self.LOOKS[DMA] = Processor._mac_reset
        # Every transfer to the cable's other chip ends at once.
        self.LOOKS[STATION] = lambda self, value: value & ~1
        self.ACTS[DMA + 0x120] = Processor._send_frames
        for port in {port for port, _ in (*board.syncs, board.fault)}:
            self.ACTS[port + 0x18] = Processor._port
            self.ACTS[port + 0x28] = Processor._port_low

    def _connect_adc(self, number, adc):
        def coupled(self):
            return number == 0 or self.registers.get(self.board.adc_common, 0) & 0b11111 == 0b00110

        def status(self, _value):
            enabled = self.registers.get(adc + 8, 0) & 1 and not self.inputs["no-adc"]
            # The regulator is ready.
            return (1 if enabled else 0) | (4 if self.eoc and number == 0 else 0) | 1 << 12

        def data(self, _value):
            if number == 0:
                # On a tick that is held up the next conversion has ended meanwhile.
                self.eoc, self.late = self.late, False
            return self.codes[number] if number < len(self.codes) and coupled(self) else 0

        self.LOOKS[adc] = status
        self.LOOKS[adc + 0x40] = data
        self.ACTS[adc + 8] = Processor._adc_control


def serve(processor):
    """Obeys lines of the standard input until it ends."""
    out = sys.stdout
    for line in sys.stdin:
        word, *rest = line.split()
        if word == "tick":
            instructions, late, *codes = map(int, rest)
            answer = processor.tick(codes, instructions, bool(late))
        elif word == "main":
            answer = processor.main(int(rest[0]))
        elif word == "reset":
            answer = processor.reset(rest[0]) or "ok"
        elif word == "input":
            processor.inputs[rest[0]] = int(rest[1])
            answer = "ok"
        elif word == "hang":
            answer = processor.hang(rest[0]) or "ok"
        elif word == "lose":
            answer = processor.lose_converters() or "ok"
        elif word == "telemetry":
            answer = processor.telemetry()
        elif word == "frames":
            answer = processor.frames()
        elif word == "frame":
            answer = processor.frame(bytes.fromhex(rest[0])) or "ok"
        elif word == "orders":
            answer = processor.orders(bytes.fromhex(rest[0])) or "ok"
        else:
            answer = f"unknown: {word}"
        out.write(answer + "\n")
        out.flush()


if __name__ == "__main__":
    serve(Processor(sys.argv[1], BOARDS[sys.argv[2]], *sys.argv[3:]))
