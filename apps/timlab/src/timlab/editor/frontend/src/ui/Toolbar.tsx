import { save } from "../commands/file";
import { toggleTheme } from "../commands/view";
import { useContextOfCommands } from "../commands/useKeys";
import { arrangeCommands } from "../commands/arrange";
import { RunControls } from "../run/RunControls";
import { type Document, useDocument } from "../session/store";
import { IconButton } from "./IconButton";
import { openDialog, setPanel, useUi } from "./ui";

/** How the diagram stands to its file. */
function stateOf({ recorded, linked, file, saved }: Document, saving: boolean): string {
  if (recorded) return "a recording";
  if (!linked) return "connection lost, reconnecting…";
  if (saving) return "saving…";
  if (file === null) return "not in a file yet";
  return saved ? `${file}, saved` : `${file}, changed`;
}

/** Above everything: the file, the run, and what is shown. */
export function Toolbar() {
  const context = useContextOfCommands();
  const { ask } = context;
  const document = useDocument();
  const { file, canUndo, canRedo } = document;
  const title = useDocument((document) => document.scopes[""]?.title);
  const { palette, inspector, dock, saving } = useUi();
  const layout = arrangeCommands.find(({ label }) => label === "Automatic layout")!;
  return (
    <header>
      <div className="toolbar" role="toolbar" aria-label="toolbar">
        <IconButton
          icon="left"
          label="Palette"
          keys="1"
          pressed={palette}
          onClick={() => setPanel("palette", !palette)}
        />
        <div className="title">
          <strong>{title || file || "Untitled"}</strong>
          <small role="status" aria-label="state of the file">
            {stateOf(document, saving)}
          </small>
        </div>
        <div className="group">
          <IconButton icon="add" label="New" keys="Alt+N" onClick={() => ask({ op: "new" })} />
          <IconButton icon="open" label="Open" keys="Ctrl+O" onClick={() => openDialog("open")} />
          <IconButton icon="save" label="Save" keys="Ctrl+S" onClick={() => save(context)} />
          <IconButton icon="gallery" label="Gallery" keys="G" onClick={() => openDialog("gallery")} />
        </div>
        <div className="group">
          <IconButton icon="undo" label="Undo" keys="Ctrl+Z" disabled={!canUndo} onClick={() => ask({ op: "undo" })} />
          <IconButton
            icon="redo"
            label="Redo"
            keys="Ctrl+Shift+Z"
            disabled={!canRedo}
            onClick={() => ask({ op: "redo" })}
          />
          <IconButton icon="layout" label="Automatic layout" keys="L" onClick={() => layout.run(context)} />
        </div>
        <RunControls />
        <div className="group last">
          <IconButton icon="search" label="Commands" keys="Ctrl+K" onClick={() => openDialog("commands")} />
          <IconButton icon="theme" label="Light or dark" keys="T" onClick={toggleTheme} />
          <IconButton icon="help" label="Keyboard shortcuts" keys="?" onClick={() => openDialog("shortcuts")} />
          <IconButton
            icon="bottom"
            label="Scopes"
            keys="3"
            pressed={dock}
            onClick={() => useUi.setState({ dock: !dock })}
          />
          <IconButton
            icon="right"
            label="Inspector"
            keys="2"
            pressed={inspector}
            onClick={() => setPanel("inspector", !inspector)}
          />
        </div>
      </div>
    </header>
  );
}
