import { existsSync, readdirSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import type { Plugin } from "vite";

const PACKAGE = /^(.*[\\/]node_modules[\\/](?:@[^\\/]+[\\/])?[^\\/]+)/;
const HOLDER = /^\s*(copyright\s+(\(c\)|©|\d{4})|\(c\)\s|©)/i;
const RULE = `\n\n${"-".repeat(80)}\n\n`;

/** The licences of the packages that these modules belong to, and of those that they need and may have built in. */
export function licencesOf(modules: Iterable<string>): string {
  const folders = new Set<string>();
  for (const id of modules) {
    const folder = PACKAGE.exec(id.replaceAll("\0", ""))?.[1];
    if (folder) folders.add(folder);
  }
  for (const folder of folders) {
    const needed = Object.keys(about(folder).dependencies ?? {}).filter((name) => !name.startsWith("@types/"));
    for (const name of needed) folders.add(found(name, folder)); // whose turn comes, too
  }
  const same = new Map<string, { heads: Set<string>; text: string }>(); // texts that differ by who holds the rights alone
  for (const folder of [...folders].sort()) {
    const { name, version, license = "as below", author } = about(folder);
    const files = readdirSync(folder).filter((each) => /^(licen[cs]e|notice)/i.test(each));
    const lines = files.flatMap((file) => readFileSync(join(folder, file), "utf8").split(/\r?\n/));
    const holders = files.length ? lines.filter((line) => HOLDER.test(line)) : [author?.name ?? author ?? ""];
    const text = files.length
      ? lines.filter((line) => !HOLDER.test(line))
      : ["It comes without the text of its licence."];
    const key = text.join(" ").replace(/\s+/g, " ").trim();
    const group = same.get(key) ?? { heads: new Set(), text: text.join("\n").trim() };
    const told = holders.map((line) => line.trim()).filter((line) => line);
    same.set(key, group);
    group.heads.add([`${name} ${version}: ${license}`, ...told].join("\n  "));
  }
  return [...same.values()].map(({ heads, text }) => `${[...heads].join("\n")}\n\n${text}`).join(RULE);
}

function about(folder: string) {
  return JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
}

/** The folder of a package that another needs: the nearest of that name. */
function found(name: string, folder: string): string {
  const place = join(folder, "node_modules", name);
  return existsSync(place) ? place : found(name, dirname(folder));
}

/** Puts the licences of all that is built in in front of it, so that every page with it has them. */
export function licences(): Plugin {
  return {
    name: "licences",
    generateBundle(_, bundle) {
      for (const part of Object.values(bundle)) {
        if (part.type !== "chunk") continue;
        const text = licencesOf(Object.keys(part.modules)).replaceAll("*/", "* /");
        if (text) part.code = `/*! Licences of what is built in:\n\n${text}\n*/\n${part.code}`;
      }
    },
  };
}
