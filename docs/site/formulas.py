"""Equations of comments, which are plain text with the letters of Unicode, as LaTeX: mathml.py draws it."""

from __future__ import annotations

import re
import unicodedata

ACCENTS = {"\u0302": r"\hat", "\u0303": r"\tilde", "\u0304": r"\bar", "\u0307": r"\dot", "\u0308": r"\ddot"}
LOWERED = dict(zip("₀₁₂₃₄₉₊₋ᵢₐ", "012349+-ia", strict=True))
RAISED = dict(zip("²³⁴⁻⁺¹½ᵀ", ["2", "3", "4", "-", "+", "1", "1/2", r"\mathsf{T}"], strict=True))
SIGNS = {">=": r"\ge ", "<=": r"\le ", "½": r"\tfrac{1}{2}", "·": r"\cdot ", "≈": r"\approx ", "≤": r"\le "}
SIGNS |= {"≥": r"\ge ", "∫": r"\int ", "‖": r"\| ", "|": r"\vert ", "±": r"\pm ", "×": r"\times ", "→": r"\to "}
SIGNS |= {"←": r"\gets ", "¼": r"\tfrac{1}{4}", "′": "′", "∞": r"\infty ", "ℓ": r"\ell ", "°": r"^{\circ}"}
SIGNS |= {sign: f"\\{sign}" for sign in "%{}&#"}
FUNCTIONS = {"sign", "sat", "sig", "reach", "sin", "cos", "exp", "ln", "max", "min", "LP", "Re", "Im"}

LETTER = r"[A-Za-z\u0370-\u03ff][\u0300-\u036f]*"
DIGITS = f"[{''.join(LOWERED)}]"
TOKEN = re.compile(
    rf"d(?P<changing>{LETTER}[xyz]?{DIGITS}*)/dt(?!\w)"
    rf"|√(?P<root>\d+|{LETTER}{DIGITS}*)"
    # Two letters are one symbol with an index where the second is an axis: Ωz, Dxx, kyy.
    rf"|(?P<letter>{LETTER})(?P<index>[xyz]{{1,2}}(?![^\W\d_])|_\w|{DIGITS}+|(?![A-Za-z])|(?<![A-Za-z]))"
    r"|(?P<word>[A-Za-z]+)"
    rf"|(?:\^(?=½))?(?P<raised>[{''.join(RAISED)}]+(?<!½)|(?<=\^)½)"
    rf"|\^(?:\((?P<inner>[^()]*)\)|(?P<power>\d+\.\d+|\w{DIGITS}*))"
    r"|(?P<sign>>=|<=|.)"
)


def block(lines: list[str]) -> str:
    """These lines as a formula in Markdown; two spaces or more separate equations, and each gets a row.

    Raises ValueError for a character that no LaTeX is known for.
    """
    rows = " \\\\\n".join(latex(each) for line in lines for each in re.split(r"\s{2,}", line.strip()))
    return f"```math\n\\begin{{array}}{{l}}\n{rows}\n\\end{{array}}\n```"


def latex(text: str) -> str:
    """One equation. Raises ValueError as `block` does."""
    return "".join(map(_token, TOKEN.finditer(unicodedata.normalize("NFD", text))))


def _token(found: re.Match[str]) -> str:
    if found["changing"]:
        return rf"\frac{{\mathrm{{d}}{latex(found['changing'])}}}{{\mathrm{{d}}t}}"
    if found["root"]:
        return rf"\sqrt{{{latex(found['root'])}}}"
    if found["letter"]:
        index = "".join(LOWERED.get(each, each) for each in found["index"].lstrip("_"))
        return _accented(found["letter"]) + (f"_{{{index}}}" if index else "")
    if found["word"]:
        word, (start, end) = found["word"], found.span()
        around = found.string[max(0, start - 1) : start], found.string[end : end + 1]
        before, after = (" " if each == " " else "" for each in around)
        return rf"\operatorname{{{word}}}" if word in FUNCTIONS else rf"\text{{{before}{word}{after}}}"
    if found["raised"]:
        return f"^{{{''.join(RAISED[each] for each in found['raised'])}}}"
    if found["inner"] or found["power"]:
        return f"^{{{latex(found['inner'] or found['power'])}}}"
    return _sign(found["sign"])


def _accented(letter: str) -> str:
    base, *marks = letter
    for mark in marks:
        base = f"{ACCENTS[mark]}{{{base}}}"
    return base


def _sign(sign: str) -> str:
    if not sign.isascii() and sign not in SIGNS:
        raise ValueError(f"an equation has the character {sign}, which docs/site/formulas.py has no LaTeX for")
    return SIGNS.get(sign, sign)
