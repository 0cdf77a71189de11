import { useState } from "react";
import { saveAs } from "../commands/file";
import { useAsk } from "../session/context";
import { useDocument } from "../session/store";
import { Modal } from "../ui/Modal";
import { closeDialog, useUi } from "../ui/ui";

const proposal = (): string => {
  const { file, scopes } = useDocument.getState();
  const title = scopes[""]?.title.toLowerCase().replace(/[^a-z0-9]+/g, "-") ?? "";
  return file ?? `${title.replace(/^-|-$/g, "") || "diagram"}.json`;
};

/** Saves under a name. */
export function Save() {
  const ask = useAsk();
  const [file, setFile] = useState(proposal);
  const saving = useUi((ui) => ui.saving);
  const [over, setOver] = useState(false);
  return (
    <Modal label="Save as">
      <form
        className="row"
        onSubmit={(event) => {
          event.preventDefault();
          void saveAs(ask, { file, over }).then((done) => done && closeDialog("save"));
        }}
      >
        <input
          data-first
          aria-label="file name"
          value={file}
          onChange={(event) => setFile(event.target.value)}
          onFocus={(event) => event.target.select()}
        />
        <button type="submit" className="primary" disabled={saving}>
          Save
        </button>
      </form>
      <label className="check">
        <input type="checkbox" checked={over} onChange={(event) => setOver(event.target.checked)} />
        replace a file of this name
      </label>
    </Modal>
  );
}
