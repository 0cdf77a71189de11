import { arrangeCommands } from "./arrange";
import type { Command } from "./command";
import { editCommands } from "./edit";
import { fileCommands } from "./file";
import { runCommands } from "./run";
import { viewCommands } from "./view";

export const COMMANDS: Command[] = [
  ...fileCommands,
  ...editCommands,
  ...arrangeCommands,
  ...runCommands,
  ...viewCommands,
];

export const byKeys = new Map(COMMANDS.flatMap((command) => (command.keys ?? []).map((keys) => [keys, command])));
