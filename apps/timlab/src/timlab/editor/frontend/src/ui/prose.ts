const SIGNS: Record<string, string> = {
  alpha: "α",
  beta: "β",
  gamma: "γ",
  delta: "δ",
  Delta: "Δ",
  epsilon: "ε",
  zeta: "ζ",
  eta: "η",
  theta: "θ",
  kappa: "κ",
  lambda: "λ",
  mu: "μ",
  nu: "ν",
  pi: "π",
  rho: "ρ",
  sigma: "σ",
  tau: "τ",
  phi: "φ",
  varphi: "φ",
  chi: "χ",
  psi: "ψ",
  omega: "ω",
  cdot: "·",
  times: "×",
  le: "≤",
  ge: "≥",
  ne: "≠",
  leftarrow: "←",
  to: "→",
  infty: "∞",
  sum: "Σ",
  exp: "exp",
  max: "max",
  min: "min",
  approx: "≈",
  equiv: "≡",
  nabla: "∇",
  dot: "d/dt ",
  pm: "±",
  propto: "∝",
  sqrt: "√",
  sin: "sin",
  cos: "cos",
  log: "log",
  dots: "…",
  mid: "|",
  lfloor: "⌊",
  rfloor: "⌋",
  lceil: "⌈",
  rceil: "⌉",
};

/** A formula of a docstring as plain text: "$\theta \leftarrow \beta\theta$" is "θ ← βθ". */
function formula(tex: string): string {
  return tex
    .replace(/\\(?:t|d)?frac\s*(?:\{([^}]*)\}|(\d))\s*(?:\{([^}]*)\}|(\d))/g, "$1$2/$3$4")
    .replace(/\\([A-Za-z]+) ?/g, (_, name: string) => SIGNS[name] ?? "")
    .replace(/\\[^A-Za-z]/g, " ")
    .replaceAll("^*", "*")
    .replace(/[{}]/g, "");
}

/** A docstring for people: formulas in plain text, lines joined to paragraphs, names without back-quotes. */
export const prose = (text: string): string =>
  text
    .replace(/\$([^$]+)\$/g, (_, tex: string) => formula(tex))
    .replace(/([^\n])\n(?![\n\-*])/g, "$1 ")
    .replaceAll("`", "")
    .replaceAll("**", "");
