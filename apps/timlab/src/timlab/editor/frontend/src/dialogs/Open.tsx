import { useEffect, useState } from "react";
import { useAsk } from "../session/context";
import { age } from "../session/recoverable";
import { useDocument } from "../session/store";
import { Modal } from "../ui/Modal";
import { closeDialog, enter } from "../ui/ui";
import { openText } from "./openText";

/** Opens a diagram of the session's folder, or any file. */
export function Open() {
  const ask = useAsk();
  const [files, setFiles] = useState<string[] | null>(null);
  const recoverable = useDocument((document) => document.recoverable);
  useEffect(() => {
    void ask({ op: "files" }).then((answer) => setFiles((answer?.files as string[] | undefined) ?? []));
  }, [ask]);
  const open = async (which: { op: "open"; file: string } | { op: "recover"; id: string }) => {
    if (!(await ask(which))) return;
    closeDialog("open");
    enter([]);
  };
  return (
    <Modal label="Open">
      <label className="file-button">
        From this computer…
        <input
          type="file"
          accept=".json,application/json"
          aria-label="file to open"
          onChange={(event) => event.target.files?.[0] && void openText(ask, event.target.files[0])}
        />
      </label>
      {recoverable.length > 0 && <h3>Unsaved work</h3>}
      <ul className="list" aria-label="unsaved work">
        {recoverable.map((work) => (
          <li key={work.id}>
            <button type="button" onClick={() => void open({ op: "recover", id: work.id })}>
              <b>{work.title || work.file || "Untitled"}</b>
              {age(work)}
            </button>
          </li>
        ))}
      </ul>
      <h3>In this folder</h3>
      {files?.length === 0 && <p className="quiet">It contains no diagrams.</p>}
      <ul className="list" aria-label="files">
        {files?.map((file) => (
          <li key={file}>
            <button type="button" onClick={() => void open({ op: "open", file })}>
              <b>{file}</b>
            </button>
          </li>
        ))}
      </ul>
    </Modal>
  );
}
