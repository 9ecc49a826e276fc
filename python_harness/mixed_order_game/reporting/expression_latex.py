"""Texts of the game files' expressions as LaTeX.

Brackets, operators and precedence of the language are Python's but for ^, a..b and the function if, so that
Python's own parser reads it once these are written in its way.
"""

import ast
import re
from collections.abc import Iterator, Mapping

TOKEN = re.compile(r"\s*(\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|[A-Za-z_]\w*|\.\.|[<>=!]=|[-+*/^()\[\],<>])")
WORDS = {"for", "in", "and", "or", "not"}
GREEK = {
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi",
    "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
}  # fmt: skip
FUNCTIONS = {
    "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "min", "max",
}  # fmt: skip
INVERSE = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}
COMPARISONS = {
    ast.Lt: "<", ast.LtE: r"\le", ast.Gt: ">", ast.GtE: r"\ge", ast.Eq: "=", ast.NotEq: r"\ne",
}  # fmt: skip

OR, AND, NOT, COMPARED, SUM, REDUCTION, PRODUCT, SIGN, POWER, ATOM = range(10)
"""How tightly an expression binds."""


def latex_of(text: str, values: Mapping[str, str] | None = None) -> str:
    """LaTeX of an expression that the game's reader takes. Raises ValueError for one that it would not.

    values: what stands for some names, the number of a player for i, say.
    """
    try:
        tree = ast.parse(" ".join(_in_python(text)), mode="eval")
    except SyntaxError as error:
        raise ValueError(f"{text!r} is no expression") from error
    return _Latex(values or {}).shown(tree.body, OR)


def name_in_latex(name: str) -> str:
    """A name: one letter and Greek as such, others upright."""
    if name in GREEK:
        return f"\\{name}"
    if len(name) == 1:
        return name
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"


def _in_python(text: str) -> Iterator[str]:
    """The tokens in Python's way: names marked by a trailing _, for they may be Python's keywords."""
    position, before = 0, ""
    text = text.rstrip()
    while position < len(text):
        found = TOKEN.match(text, position)
        if found is None:
            raise ValueError(f"{text!r} is no expression at {text[position:]!r}")
        position, word = found.end(), found[1]
        operand = bool(before) and (before[-1] in ")]" or (before not in WORDS and before[0].isalnum()))
        if word == "^":
            yield "**"
        elif word == "..":
            yield "|"  # binds less than + and more than a comparison
        elif word == "if" and operand:
            yield "if"  # of a sum
        elif word[0].isalpha() and word not in WORDS:
            yield f"{word}_"
        else:
            yield word
        before = word


class _Latex:
    """Writes a syntax tree, with brackets where something binds less than what stands around it."""

    def __init__(self, values: Mapping[str, str]) -> None:
        self.values = values

    def shown(self, node: ast.expr, least: int) -> str:
        text, binds = self._of(node)
        return text if binds >= least else rf"\left({text}\right)"

    def _of(self, node: ast.expr) -> tuple[str, int]:  # noqa: PLR0911 - one a kind of node
        match node:
            case ast.Constant(value=value):
                return _number(value), ATOM
            case ast.Name(id=name):
                return self.values.get(name[:-1]) or name_in_latex(name[:-1]), ATOM
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                entries = index.elts if isinstance(index, ast.Tuple) else [index]
                return f"{name_in_latex(name[:-1])}_{{{','.join(self.shown(e, OR) for e in entries)}}}", ATOM
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"-{self.shown(operand, SIGN)}", SUM
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return rf"\lnot {self.shown(operand, NOT)}", NOT
            case ast.BinOp():
                return self._arithmetic(node)
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                sign = COMPARISONS[type(op)]
                return f"{self.shown(left, SUM)} {sign} {self.shown(right, SUM)}", COMPARED
            case ast.BoolOp(op=op, values=values):
                sign, binds = (r"\lor", OR) if isinstance(op, ast.Or) else (r"\land", AND)
                return f" {sign} ".join(self.shown(each, binds + 1) for each in values), binds
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return self._call(name[:-1], arguments)
        raise ValueError(f"no expression: {ast.unparse(node)}")

    def _arithmetic(self, node: ast.BinOp) -> tuple[str, int]:
        left, right = node.left, node.right
        if isinstance(node.op, ast.Mult | ast.Div) and _is_negative(left):
            return f"-{self.shown(_negated(node), PRODUCT)}", SUM
        match node.op:
            case ast.Add():
                return f"{self.shown(left, SUM)} + {self.shown(right, REDUCTION)}", SUM
            case ast.Sub():
                return f"{self.shown(left, SUM)} - {self.shown(right, REDUCTION)}", SUM
            case ast.Mult():
                sign = r" \cdot " if _begins_with_digit(right) else r"\,"
                return f"{self.shown(left, PRODUCT)}{sign}{self.shown(right, SIGN)}", PRODUCT
            case ast.Div():
                return rf"\frac{{{self.shown(left, OR)}}}{{{self.shown(right, OR)}}}", SIGN
            case ast.Pow():
                return f"{self.shown(left, ATOM)}^{{{self.shown(right, OR)}}}", POWER
        raise ValueError(f"no expression: {ast.unparse(node)}")

    def _call(self, name: str, arguments: list[ast.expr]) -> tuple[str, int]:  # noqa: PLR0911 - likewise
        if name in ("sum", "prod") and isinstance(arguments[0], ast.GeneratorExp):
            return self._reduction(name, arguments[0])
        shown = [self.shown(each, OR) for each in arguments]
        match name:
            case "sqrt":
                return rf"\sqrt{{{shown[0]}}}", ATOM
            case "abs":
                return rf"\left|{shown[0]}\right|", ATOM
            case "floor":
                return rf"\left\lfloor {shown[0]}\right\rfloor", ATOM
            case "mod":
                return rf"{self.shown(arguments[0], PRODUCT)} \bmod {self.shown(arguments[1], SIGN)}", PRODUCT
            case "if":
                chosen = rf"{shown[1]} & {shown[0]} \\ {shown[2]} & \text{{otherwise}}"
                return rf"\begin{{cases}}{chosen}\end{{cases}}", ATOM
        word = INVERSE.get(name, name)
        head = f"\\{word}" if name in FUNCTIONS or name in INVERSE else rf"\operatorname{{{word}}}"
        return rf"{head}\left({', '.join(shown)}\right)", ATOM

    def _reduction(self, name: str, body: ast.GeneratorExp) -> tuple[str, int]:
        (loop,) = body.generators
        if not (isinstance(loop.iter, ast.BinOp) and isinstance(loop.iter.op, ast.BitOr)):
            raise ValueError(f"no expression: {ast.unparse(body)}")  # noqa: TRY004 - of a text
        first, last = self.shown(loop.iter.left, SUM), self.shown(loop.iter.right, SUM)
        bound = ast.unparse(loop.target)[:-1]  # hides what it may stand for outside
        inside = _Latex({name: value for name, value in self.values.items() if name != bound})
        under = f"{name_in_latex(bound)}={first}"
        if loop.ifs:
            under = rf"{under},\ {inside.shown(loop.ifs[0], OR)}"
        return rf"\{name}_{{{under}}}^{{{last}}} {inside.shown(body.elt, REDUCTION)}", REDUCTION


def _is_negative(node: ast.expr) -> bool:
    """Whether a product begins with a minus sign, which then is that of the whole product."""
    while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        node = node.left
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)


def _negated(node: ast.expr) -> ast.expr:
    """The product without the minus sign that it begins with."""
    if isinstance(node, ast.BinOp):
        return ast.BinOp(_negated(node.left), node.op, node.right)
    return node.operand if isinstance(node, ast.UnaryOp) else node


def _begins_with_digit(node: ast.expr) -> bool:
    """Whether a product sign is needed before it."""
    while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Pow):
        node = node.left
    return isinstance(node, ast.Constant)


def _number(value: object) -> str:
    """A number as it is read: 0.5, 3 for 3.0, a power of ten where it has many zeros."""
    mantissa, _, exponent = f"{value:.12g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa
