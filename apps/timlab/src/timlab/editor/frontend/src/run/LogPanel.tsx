import { download } from "../commands/file";
import { useAsk } from "../session/context";
import { useRun } from "../session/store";
import { toText } from "../inspector/values";
import { toast } from "../ui/ui";

/** What was changed in this branch, at which tick; to be kept, and run again bit for bit. */
export function LogPanel() {
  const ask = useAsk();
  const branch = useRun((run) => run.branches.find(({ name }) => name === run.branch));
  const keep = async () => {
    const answer = await ask({ op: "log" });
    if (answer) download(`${branch?.name ?? "run"}.log.json`, JSON.stringify(answer.log, null, 1));
  };
  const replay = async (file: File) => {
    try {
      await ask({ op: "replay", log: JSON.parse(await file.text()) as object });
    } catch {
      toast(`${file.name}: is not a log`, true);
    }
  };
  return (
    <div className="form">
      <div className="row">
        <button type="button" className="plain" disabled={!branch} onClick={() => void keep()}>
          Keep the log
        </button>
        <label className="file-button">
          Replay…
          <input
            type="file"
            accept=".json"
            aria-label="log to replay"
            onChange={(event) => event.target.files?.[0] && void replay(event.target.files[0])}
          />
        </label>
      </div>
      {branch?.parent && (
        <p className="quiet">
          {branch.name} left {branch.parent} at tick {branch.start}.
        </p>
      )}
      {!branch?.changes.length && <p className="quiet">No changes during this run.</p>}
      <ol className="log" aria-label="log">
        {branch?.changes.map(({ tick, address, value }, place) => (
          <li key={place}>
            <small>{tick}</small>
            <span>{address}</span>
            <code>{toText(value)}</code>
          </li>
        ))}
      </ol>
    </div>
  );
}
