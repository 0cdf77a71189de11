import { COMMANDS } from "../commands/all";
import { written } from "../commands/command";
import { useContextOfCommands } from "../commands/useKeys";
import { Picker } from "../ui/Picker";

export function CommandPalette() {
  const context = useContextOfCommands();
  const choices = COMMANDS.map((command) => ({
    id: command.label,
    label: command.label,
    note: command.keys?.map(written).join(" or "),
    pick: () => command.run(context),
  }));
  return <Picker label="Commands" hint="What to do?" choices={choices} />;
}
