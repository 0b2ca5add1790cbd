"""The bus of the peripherals: from an address to a device and its register."""

PERIPHERALS = 0x4000_0000
BIT_BAND = 0x4200_0000


class Device:
    """A page of registers. Unless a device says otherwise, a register holds what was written last."""

    def __init__(self):
        self.values = {}

    def read(self, offset):
        return self.values.get(offset, 0)

    def write(self, offset, value):
        self.values[offset] = value


class Registers:
    """Gives each access of the core to the device of its page (1 KiB)."""

    def __init__(self):
        self.pages = {}

    def add(self, address, device, size=0x400):
        for page in range(address >> 10, (address + size) >> 10):
            self.pages[page] = (device, address)

    def _device(self, address):
        found = self.pages.get(address >> 10)
        if found is None:
            found = (Device(), address & ~0x3FF)
            self.pages[address >> 10] = found
        return found

    def read(self, address, size):
        device, base = self._device(address)
        word = device.read((address & ~3) - base)
        return (word >> (8 * (address & 3))) & ((1 << (8 * size)) - 1)

    def write(self, address, size, value):
        device, base = self._device(address)
        offset = (address & ~3) - base
        if size < 4:
            narrow = getattr(device, "write_narrow", None)
            if narrow is not None:
                narrow(address - base, size, value)
                return
            shift, mask = 8 * (address & 3), (1 << (8 * size)) - 1
            value = (device.read(offset) & ~(mask << shift)) | ((value & mask) << shift)
        device.write(offset, value)

    def attach(self, uc, ranges):
        """Maps the ranges of addresses, and the bit-band alias of the peripherals, onto the devices."""
        for base, size in ranges:
            uc.mmio_map(base, size, self._reader(base), None, self._writer(base), None)
        uc.mmio_map(BIT_BAND, 0x200_0000, self._read_bit, None, self._write_bit, None)

    def _reader(self, base):
        return lambda uc, offset, size, _: self.read(base + offset, size)

    def _writer(self, base):
        return lambda uc, offset, size, value, _: self.write(base + offset, size, value)

    def _read_bit(self, uc, offset, size, _):
        word, bit = PERIPHERALS + (offset >> 5 & ~3), offset >> 2 & 31
        return self.read(word, 4) >> bit & 1

    def _write_bit(self, uc, offset, size, value, _):
        word, bit = PERIPHERALS + (offset >> 5 & ~3), offset >> 2 & 31
        old = self.read(word, 4)
        self.write(word, 4, old | 1 << bit if value & 1 else old & ~(1 << bit))
