import { useEffect, useState } from "react";
import { useAsk } from "../session/context";
import { useDocument } from "../session/store";
import { Modal } from "../ui/Modal";
import { enter, openDialog } from "../ui/ui";
import { openText } from "./openText";

/** Opens a diagram of the session's folder, or any file. */
export function Open() {
  const ask = useAsk();
  const [files, setFiles] = useState<string[] | null>(null);
  const recoverable = useDocument((document) => document.recoverable);
  useEffect(() => {
    void ask({ op: "files" }).then((answer) => setFiles((answer?.files as string[] | undefined) ?? []));
  }, [ask]);
  const open = async (file: string) => {
    if (!(await ask({ op: "open", file }))) return;
    openDialog(null);
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
      <ul className="list">
        {recoverable.map(({ id, title, file, time }) => (
          <li key={id}>
            <button type="button" onClick={() => void ask({ op: "recover", id }).then(() => openDialog(null))}>
              <b>{title || file || "Untitled"}</b>
              {time}
            </button>
          </li>
        ))}
      </ul>
      <h3>In this folder</h3>
      {files?.length === 0 && <p className="quiet">There are no diagrams in it.</p>}
      <ul className="list" aria-label="files">
        {files?.map((file) => (
          <li key={file}>
            <button type="button" onClick={() => void open(file)}>
              <b>{file}</b>
            </button>
          </li>
        ))}
      </ul>
    </Modal>
  );
}
