"""Many mutants in one copy of the headers: each stands beside the original behind a switch that CFP_MUTANT sets at run time.

A mutant of an expression becomes `cfp_mutant == 7 ? (mutated) : (original)`, of a statement `if (cfp_mutant == 7) {mutated} else
{original}`. So a test is compiled once for all of them. What neither form can hold (constants of types, constant expressions,
expressions whose type changes) the compiler names, and it is built alone.
"""
import re
from collections import defaultdict

from mutants import ROOT

SWITCH = 'extern "C" { extern const int cfp_mutant; }  '  # in front of each header's first line, which is a comment
SWITCH_UNIT = """#include <cstdlib>
extern "C" { extern const int cfp_mutant; }
static int asked() { const char* text = std::getenv("CFP_MUTANT"); return text ? std::atoi(text) : 0; }
const int cfp_mutant = asked();
"""
BODY = re.compile(r"(\)|\bconst|\bnoexcept|\boverride|\belse|\bdo|->\s*[\w:<>]+)\s*$")
DECLARATION = re.compile(r"\s*(?:const |static |inline |mutable )*[\w:]+(?:<[^=;()]*>)?(?:::\w+)?[\s&*]+(?:const )?\w+\s*$")
CONSTRUCTION = re.compile(r"\s*(?:const )?[\w:]+(?:<[^=;()]*>)?[\s&*]+\w+\s*(?=[({])")
OPEN, CLOSE = "([{", ")]}"


def blanked(text, strings):
    pattern = r"//[^\n]*" + (r"|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])'" if strings else r"|\"(?:\\.|[^\"\\\n])*\"")
    return re.sub(pattern, lambda m: m.group(0) if not strings and m.group(0)[0] != "/" else " " * len(m.group(0)), text)


def closing(text, at):
    """Place of the bracket that closes the one at `at`, or the end."""
    depth = 0
    for k in range(at, len(text)):
        depth += (text[k] in OPEN) - (text[k] in CLOSE)
        if depth == 0:
            return k
    return len(text)


def pieces(text, a, b, mark):
    """[a, b) cut at every `mark` outside of brackets."""
    start, depth = a, 0
    for k in range(a, b):
        depth += (text[k] in OPEN) - (text[k] in CLOSE)
        if depth == 0 and text[k] == mark:
            yield start, k
            start = k + 1
    yield start, b


def holder(text, a, b, r, mark):
    return next(((x, y) for x, y in pieces(text, a, b, mark) if x <= r[0] and r[1] <= y), None)


def argument(text, a, b, r):
    """The argument of the innermost bracket around r."""
    inner = None
    for k in range(a, r[0]):
        if text[k] in "({" and k + 1 <= r[0] and r[1] <= closing(text, k):
            inner = k
    found = inner is not None and holder(text, inner + 1, closing(text, inner), r, ",")
    return ("expression", *found) if found else None


def place(text, a, b, r):
    """(form, start, end) of the smallest whole part of text[a:b] around the changed region r, or None."""
    for k in reversed(range(a, r[0])):  # the innermost body of a function or lambda on these lines
        if text[k] == "{" and r[1] <= closing(text, k) and BODY.search(text[a:k]):
            end = closing(text, k)
            if end < b:
                found = holder(text, k + 1, end, r, ";")
                return found and place(text, found[0], min(found[1] + 1, end), r)
            break
    start = re.match(r"[\s}]*(?:else\b)?\s*", text[a:b]).end() + a
    head = re.match(r"(if|while|switch|for)\s*\(", text[start:b])
    if re.match(r"if constexpr|CFP_ASSERT|case|template|do\b", text[start:b]):
        return None
    if head:
        opened = start + head.end() - 1
        closed = closing(text, opened)
        if r[0] >= closed:
            return place(text, closed + 1, b, r)
        if head.group(1) != "for":
            return ("expression" if head.group(1) == "switch" else "condition"), opened + 1, closed
        parts = list(pieces(text, opened + 1, closed, ";"))
        if len(parts) != 3:
            colon = text.find(" : ", opened)
            return ("expression", colon + 3, closed) if 0 < colon < r[0] else None
        index = next((i for i, (x, y) in enumerate(parts) if x <= r[0] and r[1] <= y), None)
        if index is None:
            return None
        return (initialiser(text, *parts[0], r), ("condition", *parts[1]), ("step", *parts[2]))[index]
    if re.match(r"return\b", text[start:b]):
        return ("statement", start, b) if text[:b].rstrip().endswith(";") else None
    found = initialiser(text, start, b, r)
    if found or re.match(r"(static )?constexpr\b", text[start:b]):
        return found
    if not text[:b].rstrip().endswith(";"):
        return argument(text, start, b, r)
    if CONSTRUCTION.match(text[start:b]):
        return argument(text, start, b, r)
    return "statement", start, b


def initialiser(text, a, b, r):
    equal = re.search(r"(?<![<>=!+*/|&-])=(?!=)", text[a:b])
    if not equal or not DECLARATION.match(text[a : a + equal.start()]) or re.match(r"\s*(else|return)\b", text[a:b]):
        return None
    end = len(text[:b].rstrip().rstrip(";"))
    found = holder(text, a + equal.end(), end, r, ",")
    if not found:
        return None
    later = re.match(r"\s*\w+ = ", text[found[0] : found[1]]) if found[0] != a + equal.end() else None
    first = found[0] + (later.end() if later else 0)
    return None if text[first : found[1]].lstrip().startswith("{") else ("expression", first, found[1])


def statements_of(blank):
    """(first line, line after the last) of what belongs together."""
    first, depth = 0, 0
    for k, line in enumerate(blank):
        depth += sum(line.count(c) for c in "([") - sum(line.count(c) for c in ")]")
        text = line.strip()
        if depth <= 0 and (not text or text[0] == "#" or text[-1] in ";{}" or re.search(r"(public|private|protected|case .*|default):$", text)):
            yield first, k + 1
            first, depth = k + 1, 0
    yield first, len(blank)


class Switched:
    """The headers with the switches of `mutants`, as far as they fit; `number[id]` is what CFP_MUTANT has to say."""

    def __init__(self, mutants):
        self.headers, self.number, self.dropped = defaultdict(list), {}, set()
        for k, mutant in enumerate(mutants, 1):
            self.headers[mutant.header].append(mutant)
            self.number[mutant.id] = k
        self.places = {}

    def text(self, header):
        """The header with its switches; forgets the mutants that fit no form."""
        source = (ROOT / "include" / header).read_text()
        lines, plain, blank = (t.split("\n") for t in (source, blanked(source, False), blanked(source, True)))
        waiting = defaultdict(list)
        for mutant in self.headers[header]:
            if mutant.id not in self.dropped:
                waiting[mutant.line].append(mutant)
        written = []
        for first, last in statements_of(blank):
            mine = [m for line in range(first, last) for m in waiting.get(line, [])]
            following = next((t.strip() for t in blank[last:] if t.strip()), "")
            code = self.switched(header, first, plain[first:last], blank[first:last], lines[first:last], mine, following) if mine else None
            written.append("\n".join(lines[first:last]) if code is None else f'{code}\n#line {last + 1} "{header}"')
        return SWITCH + "\n".join(written)

    def switched(self, header, first, plain, blank, lines, mutants, following):
        text, parse = "\n".join(plain), "\n".join(blank)
        parts, whole = defaultdict(list), []
        for m in mutants:
            row = m.line - first
            offset = sum(len(line) + 1 for line in plain[:row])
            indent = len(lines[row]) - len(lines[row].lstrip())
            after = blanked(m.after, False)
            if m.kind == "statement":
                fits = row == 0 and len(plain) == 1 and not following.startswith("else")
                whole.append(m) if fits else self.dropped.add(m.id)
                continue
            same = next((i for i, (x, y) in enumerate(zip(m.before, m.after)) if x != y), min(len(m.before), len(m.after)))
            tail = 0
            while tail < min(len(m.before), len(m.after)) - same and m.before[-1 - tail] == m.after[-1 - tail]:
                tail += 1
            changed = offset + indent + same, offset + indent + len(m.before) - tail
            found = place(parse, 0, len(parse), changed)
            if found and found[0] == "statement" and following.startswith("else"):
                found = None
            if not found or any(found != other and found[1] < other[2] and other[1] < found[2] for other in parts):
                self.dropped.add(m.id)
                continue
            body = text[: offset + indent] + after + text[offset + indent + len(blanked(m.before, False)) :]
            parts[found].append((m, body[found[1] : found[2] + len(body) - len(text)]))
        if not parts and not whole:
            return None
        code, end = "", len(text)
        for (form, a, b), variants in sorted(parts.items(), reverse=True):
            code = self.joined(header, first, form, text[a:b], variants) + text[b:end] + code
            end = a
        code = text[:end] + code
        for m in whole:
            code = f'\n#line 1 "mutant_{m.id}"\nif (cfp_mutant == {self.number[m.id]}) {{}} else {{\n#line {first + 1} "{header}"\n{code} }}'
        return code

    def joined(self, header, first, form, original, variants):
        before, after = {"statement": ("{ ", " }"), "step": ("(void)(", ")"), "condition": ("static_cast<bool>(", ")"), "expression": ("(", ")")}[form]
        code = ""
        for m, mutated in variants:
            test = f"cfp_mutant == {self.number[m.id]}"
            code += f'\n#line 1 "mutant_{m.id}"\n' + (f"if ({test}) " if form == "statement" else f"{test} ? ")
            code += before + mutated.replace("\n", " ") + after + (" else" if form == "statement" else " :")
        code += f'\n#line {first + 1} "{header}"\n' + before + original.replace("\n", " ") + after
        return code if form == "step" else f"{{ {code} }}" if form == "statement" else f"({code})"

    def write(self, folder):
        for header in self.headers:
            path, text = folder / header, self.text(header)
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists() or path.read_text() != text:
                path.write_text(text)

    def learn(self, output):
        """Drops the mutants that the compiler's errors name, or else the nearest above an error; True when there are some."""
        before = len(self.dropped)
        errors = re.split(r"(?m)^(?=\S*?:\d+:\d+: (?:fatal )?error: )", output)[1:]
        for error in errors:
            first = re.findall(r"mutant_([0-9a-f]{10}):1:", error.split("\n")[0])
            self.dropped.update(first or re.findall(r"mutant_([0-9a-f]{10}):1:", error))
        for error in errors if len(self.dropped) == before else []:
            header, line = re.match(r"\S*?(cfp/[^:]*|[^:/]*):(\d+):", error).groups()
            above = [m for m in self.headers.get(header, []) if m.id not in self.dropped and m.line < int(line)]
            self.dropped.update(m.id for m in above if m.line == max(n.line for n in above))
        return len(self.dropped) > before
