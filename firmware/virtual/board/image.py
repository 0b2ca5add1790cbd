"""The release image: its segments, its symbols, and where it waits."""
import bisect

from elftools.elf.elffile import ELFFile

WFE, WFI, SEV, NOP = b"\x20\xbf", b"\x30\xbf", b"\x40\xbf", b"\x00\xbf"
TO_ITSELF, TO_NOP_BEFORE = b"\xfe\xe7", b"\xfd\xe7"


class Image:
    def __init__(self, path):
        with open(path, "rb") as file:
            elf = ELFFile(file)
            loads = [part for part in elf.iter_segments() if part["p_type"] == "PT_LOAD" and part["p_filesz"]]
            self.segments = [(part["p_paddr"], part.data()) for part in loads]
            symbols = list(elf.get_section_by_name(".symtab").iter_symbols())
            text = elf.get_section_by_name(".text")
            code, start = text.data(), text["sh_addr"]
        values = {symbol.name: symbol["st_value"] for symbol in symbols}
        self.stack = (values["_stack_end"], values["_stack_start"])
        functions = (symbol for symbol in symbols if symbol["st_info"]["type"] == "STT_FUNC")
        self._functions = sorted((symbol["st_value"] & ~1, symbol.name) for symbol in functions)
        # The core stops only where one of them is executed, so the same bytes in a constant do no harm.
        found = {start + at: code[at : at + 2] for at in range(0, len(code) - 1, 2)}
        self.waits = {at: word == WFE for at, word in found.items() if word in (WFE, WFI)}
        # Loops that do nothing, such as the idle of RTIC: time passes there until something happens.
        self.spins = {at for at, word in found.items() if word == TO_ITSELF}
        self.spins |= {at for at, word in found.items() if word == NOP and found.get(at + 2) == TO_NOP_BEFORE}
        self.sevs = [at for at, word in found.items() if word == SEV]

    def name_of(self, address):
        place = bisect.bisect_right(self._functions, (address & ~1, "\x7f")) - 1
        return f"{self._functions[place][1]} (0x{address:08x})" if place >= 0 else f"0x{address:08x}"
