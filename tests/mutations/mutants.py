"""The places of include/cfp where a small change is possible, and a seeded choice among them."""
import hashlib
import pathlib
import random
import re
from collections import defaultdict, namedtuple

ROOT = pathlib.Path(__file__).resolve().parents[2]
Mutant = namedtuple("Mutant", "id room header line kind before after")

SWAPS = {
    "comparison": {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="},
    "sign": {"+": "-", "-": "+", "+=": "-=", "-=": "+="},
    "factor": {"*": "/", "/": "*", "*=": "/=", "/=": "*="},
    "logic": {"&&": "||", "||": "&&"},
    "extreme": {"min": "max", "max": "min", "fmin": "fmax", "fmax": "fmin", "true": "false", "false": "true"},
}
OPERAND = r"[\w.:]+(?:\([^()]*\)|\[[^\[\]]*\])*"
IDLE = re.compile(r"^\s*(#|using |template|static_assert|CFP_ASSERT|namespace|inline namespace|enum |friend |struct |class |//|\}|$)")


def changed_constant(match):
    text = match.group(0)
    if not re.search(r"[.e]", text):
        return str(int(text) + 1)
    value = float(text)
    return repr(2 * value) if value else "0.5"


def changes(line):
    """(kind, start, end, replacement) of every small change of a line whose comments and strings are blank."""
    for match in re.finditer(r" (<=?|>=?|[=!]=|[-+*/]=?|&&|\|\|) (?=\S)", line):
        for kind, swap in SWAPS.items():
            if match.group(1) in swap:
                yield kind, *match.span(1), swap[match.group(1)]
    for match in re.finditer(r"(?<=std::)(f?min|f?max)\b|\b(true|false)\b", line):
        yield "extreme", *match.span(), SWAPS["extreme"][match.group(0)]
    for match in re.finditer(r"(?<![\w.<>])\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])", line):
        yield "constant", *match.span(), changed_constant(match)
    for match in re.finditer(r"!(?=[\w(])|(?<=[(,=] )-(?=\w)|(?<=\()-(?=\w)|(?<=return )-(?=\w)", line):
        yield "sign" if match.group(0) == "-" else "logic", *match.span(), ""
    for match in re.finditer(rf" [-+] {OPERAND}(?=[;,)\]])| (?:&&|\|\|) !?{OPERAND}(?=[;,)])", line):
        yield "term", *match.span(), ""
    for match in re.finditer(r"(?<!swap\()(?<!multiply_add\()(?<!std::min\)\()(?<!std::max\)\()(?<=\()(\w+), (\w+)(?=[,)])", line):
        yield "argument", *match.span(), f"{match.group(2)}, {match.group(1)}"
    if re.match(r"^\s+(if \(.*\) (return.*|continue|break|[\w.>\[\]()-]+ [-+*/]?= .*)|[\w.>\[\]()-]+ [-+*/]?= .*|[\w:.>-]+\(.*\)|continue|break);$", line):
        indent = len(line) - len(line.lstrip())
        yield "statement", indent, len(line), ";"


def without_words(text):
    """The same text with comments and literals blank, so that positions stay."""
    return re.sub(r"//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])'", lambda m: " " * len(m.group(0)), text)


def mutants_of(header):
    text = (ROOT / "include" / header).read_text()
    lines, seen = text.splitlines(), defaultdict(int)
    blank = without_words(text).splitlines()
    for number, line in enumerate(blank):
        complete = number == 0 or not blank[number - 1].strip() or blank[number - 1].rstrip().endswith((";", "{", "}", ":"))
        if IDLE.match(line):
            continue
        for kind, start, end, replacement in changes(line.rstrip()):
            if kind == "statement" and not complete:
                continue
            before, after = lines[number].strip(), (lines[number][:start] + replacement + lines[number][end:]).strip()
            if before == after:
                continue
            seen[before, after] += 1
            name = f"{header}|{before}|{after}|{seen[before, after]}"
            yield Mutant(hashlib.sha1(name.encode()).hexdigest()[:10], header.split("/")[1], header, number, kind, before, after)


def chosen(seed, only, headers_per_room=None):
    """Every mutant, or those of some headers, in an order of which each beginning is spread over rooms (by the root of their size) and kinds."""
    headers = sorted(p.relative_to(ROOT / "include").as_posix() for p in (ROOT / "include/cfp").glob("*/**/*.hpp"))
    rooms = defaultdict(lambda: defaultdict(list))
    if headers_per_room:
        for room in {header.split("/")[1] for header in headers}:
            mine = sorted((h for h in headers if h.split("/")[1] == room), key=lambda h: hashlib.sha1(f"{seed} {h}".encode()).digest())
            headers = [h for h in headers if h not in mine[headers_per_room:]]
    for header in headers:
        for mutant in mutants_of(header):
            if not only or mutant.room in only or header.endswith(tuple(only)):
                rooms[mutant.room][mutant.kind].append(mutant)
    dealt = []
    for room, kinds in sorted(rooms.items()):
        ranked = []
        for kind, mutants in sorted(kinds.items()):
            generator = random.Random(f"{seed} {room} {kind}")
            mutants.sort(key=lambda m: m.id)
            generator.shuffle(mutants)
            ranked += [(rank + generator.random(), m) for rank, m in enumerate(mutants)]
        size = sum(len(mutants) for mutants in kinds.values())
        ranked.sort(key=lambda item: item[0])
        dealt += [((place + 0.5) / size**0.5, m) for place, (_, m) in enumerate(ranked)]
    return [m for _, m in sorted(dealt, key=lambda item: item[0])]


def written(mutant, folder):
    """Lays the mutated header into the folder."""
    lines = (ROOT / "include" / mutant.header).read_text().splitlines(keepends=True)
    old = lines[mutant.line]
    lines[mutant.line] = old[: len(old) - len(old.lstrip())] + mutant.after + "\n"
    path = folder / mutant.header
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(lines))
