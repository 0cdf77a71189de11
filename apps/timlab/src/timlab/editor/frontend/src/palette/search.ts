import type { Declaration } from "../session/types";

/** How well a type answers to what is sought: the name's beginning first, then its words, then the help. */
function rank(declaration: Declaration, words: string[]): number {
  const name = declaration.name.toLowerCase();
  const all = `${name} ${declaration.category} ${declaration.help}`.toLowerCase();
  if (!words.every((word) => all.includes(word))) return 0;
  const sought = words.join(" ");
  if (name === sought) return 5;
  if (name.startsWith(sought)) return 4;
  if (words.every((word) => name.includes(word))) return 3;
  return declaration.category.toLowerCase().includes(sought) ? 2 : 1;
}

/** The types that answer to a search, best first. */
export function found(declarations: Declaration[], text: string): Declaration[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return declarations
    .map((declaration) => ({ declaration, rank: rank(declaration, words) }))
    .filter((each) => each.rank > 0)
    .sort((a, b) => b.rank - a.rank || a.declaration.name.localeCompare(b.declaration.name))
    .map((each) => each.declaration);
}
