"""The core: executes instructions, enters and leaves interrupts, sleeps. One instruction takes one cycle."""
import struct

from unicorn import UC_ARCH_ARM, UC_HOOK_BLOCK, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, UcError
from unicorn import arm_const as arm

from .nvic import IDLE

TRAP = 0x1FFE_0000
"""Where an interrupt handler returns to, and where a task that hangs stays: a page that no chip has."""
RETURN, HANG = TRAP, TRAP + 0x10
NEVER = 0xFFFF_FFFE
PAINT = 0xA5
IT_BITS = 0x0600_FC00
# Taking an interrupt and returning from it take 12 cycles each on a Cortex-M4.
ENTRY_CYCLES = 12
FRAME = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR)
# Eight words, and eighteen of the FPU, for which a core with FPU makes room.
FRAME_BYTES = 26 * 4


class Fault(Exception):
    """The core cannot go on: a fault of the firmware, or an instruction or address that the model lacks."""


class Core:
    def __init__(self, image, model, ram, clock, nvic, registers, ranges):
        self.image, self.clock, self.nvic, self.ram = image, clock, nvic, ram
        uc = self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(model)
        uc.mem_map(0x0800_0000, 0x20_0000)
        for base, size in ram:
            uc.mem_map(base, size)
        uc.mem_map(TRAP, 0x1000)
        uc.mem_write(RETURN, b"\xfe\xe7" * 16)  # branches to themselves
        registers.attach(uc, ranges)
        for address, data in image.segments:
            uc.mem_write(address, data)
        uc.hook_add(UC_HOOK_BLOCK, self._on_block)
        for address in image.waits:
            uc.hook_add(UC_HOOK_CODE, self._on_wait, begin=address, end=address)
        for address in image.sevs:
            uc.hook_add(UC_HOOK_CODE, self._on_sev, begin=address, end=address)
        self._costs = {}
        self._spins = image.spins | {HANG}
        self.busy = 0
        """Cycles that were not slept."""
        self.interrupted = 0
        """Cycles within interrupts."""
        self.reset()

    def reset(self):
        sp, entry = struct.unpack("<II", self.uc.mem_read(0x0800_0000, 8))
        for register in range(13):
            self.uc.reg_write(arm.UC_ARM_REG_R0 + register, 0)
        self.uc.reg_write(arm.UC_ARM_REG_PRIMASK, 0)
        self.uc.reg_write(arm.UC_ARM_REG_BASEPRI, 0)
        self.uc.reg_write(arm.UC_ARM_REG_SP, sp)
        self.uc.reg_write(arm.UC_ARM_REG_LR, 0xFFFF_FFFF)
        self.pc = entry & ~1
        self.contexts = []
        self.asleep = None
        self._returns = False
        self.hang_in = None
        self.stall_until = 0
        """The core executes nothing before this cycle."""
        base, top = self.image.stack
        self.uc.mem_write(base, bytes([PAINT]) * (top - base))

    def stack_used(self):
        """The bytes of the stack that were ever written since the reset."""
        base, top = self.image.stack
        memory = bytes(self.uc.mem_read(base, top - base))
        return len(memory.lstrip(bytes([PAINT])))

    def hang(self, irq=None):
        """Makes the code that runs outside of interrupts, or in the given one, go round for ever from when it runs next."""
        self.hang_in = (irq,)

    def _cost(self, address, size):
        cost = self._costs.get(address)
        if cost is None or cost[0] != size:
            code, at, count = bytes(self.uc.mem_read(address, size)), 0, 0
            while at + 1 < size:
                at += 4 if code[at + 1] >> 3 in (0x1D, 0x1E, 0x1F) else 2
                count += 1
            cost = self._costs[address] = (size, max(1, count))
        return cost[1]

    def _is_due(self):
        best = self.nvic.best
        if best is None or best[0] >= self.nvic.priority():
            return False
        if self.uc.reg_read(arm.UC_ARM_REG_PRIMASK) & 1:
            return False
        # Within an IT block the rest of it would be saved with the status; the interrupt waits for its end, three instructions.
        if self.uc.reg_read(arm.UC_ARM_REG_XPSR) & IT_BITS:
            return False
        base = self.uc.reg_read(arm.UC_ARM_REG_BASEPRI) & 0xF0
        return not base or best[0] < base

    def _on_block(self, uc, address, size, _):
        if address == RETURN:
            self._returns = True
            uc.emu_stop()
            return
        clock = self.clock
        if clock.now >= clock.limit or (self.nvic.best is not None and self._is_due()):
            uc.emu_stop()
            return
        if address in self._spins:
            clock.now = clock.limit
            uc.emu_stop()
            return
        cost = self._cost(address, size)
        clock.now += cost
        self.busy += cost
        if self.nvic.active:
            self.interrupted += cost

    def _on_wait(self, uc, address, _size, _):
        is_wfe = self.image.waits[address]
        uc.reg_write(arm.UC_ARM_REG_PC, (address + 2) | 1)
        self.asleep = "wfe" if is_wfe else "wfi"
        uc.emu_stop()

    def _on_sev(self, *_):
        self.nvic.event = True

    def _enter(self):
        context = self.uc.context_save()
        sp = self.uc.reg_read(arm.UC_ARM_REG_SP)
        irq = self.nvic.enter()
        frame = [self.uc.reg_read(register) & 0xFFFF_FFFF for register in FRAME] + [self.pc, 0x0100_0000]
        lower = (sp - FRAME_BYTES) & ~7
        self.uc.mem_write(lower, struct.pack("<8I", *frame))
        self.uc.reg_write(arm.UC_ARM_REG_SP, lower)
        self.uc.reg_write(arm.UC_ARM_REG_LR, RETURN | 1)
        self.contexts.append((context, self.pc))
        vector = self.nvic.vtor + 4 * (16 + irq)
        self.pc = struct.unpack("<I", self.uc.mem_read(vector, 4))[0] & ~1
        self.clock.now += ENTRY_CYCLES

    def _leave(self):
        context, self.pc = self.contexts.pop()
        self.uc.context_restore(context)
        self.nvic.leave()
        self.clock.now += ENTRY_CYCLES

    def _wakes(self):
        best = self.nvic.best
        pending = best is not None and best[0] < self.nvic.priority()
        if self.asleep == "wfe" and self.nvic.event:
            self.nvic.event = False
            return True
        return pending

    def run(self, until):
        """Runs to a cycle, or until the firmware asks for a reset."""
        clock, uc = self.clock, self.uc
        while clock.now < until and not self.nvic.reset_requested:
            clock.run_due()
            if self.nvic.reset_requested:
                break
            upcoming = clock.next()
            clock.limit = until if upcoming is None else min(until, upcoming)
            if self.stall_until > clock.now:
                clock.now = max(clock.now, min(clock.limit, self.stall_until))
                continue
            if self.asleep:
                if self._wakes():
                    self.asleep = None
                else:
                    clock.now = max(clock.now, clock.limit)
                    continue
            if self._is_due():
                self._enter()
            if self.hang_in is not None and self.hang_in[0] == (self.nvic.active[-1] if self.nvic.active else None):
                self.pc, self.hang_in = HANG, None
            self._returns = False
            try:
                uc.emu_start(self.pc | 1, NEVER)
            except UcError as error:
                pc, lr = uc.reg_read(arm.UC_ARM_REG_PC), uc.reg_read(arm.UC_ARM_REG_LR)
                places = f"{self.image.name_of(pc)}, called from {self.image.name_of(lr)}"
                raise Fault(f"{error} at {clock.us():.0f} us in {places}") from error
            self.pc = uc.reg_read(arm.UC_ARM_REG_PC) & ~1
            if self._returns:
                self._leave()

    def is_in_thread(self):
        return self.nvic.priority() == IDLE
