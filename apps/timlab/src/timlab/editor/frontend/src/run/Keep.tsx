import { download } from "../commands/file";
import { asCsv, asPng, asSvg, type Wanted } from "./pictures";

/** Keeps what a scope shows, as numbers or as a picture. */
export function Keep({ wanted }: { wanted: Wanted }) {
  const name = wanted.source.path.replaceAll("/", "-");
  const keep = {
    CSV: () => download(`${name}.csv`, asCsv(wanted), "text/csv"),
    PNG: async () => download(`${name}.png`, await asPng(wanted), "image/png"),
    SVG: () => download(`${name}.svg`, asSvg(wanted), "image/svg+xml"),
  };
  return (
    <span className="keep">
      {Object.entries(keep).map(([kind, save]) => (
        <button
          key={kind}
          type="button"
          aria-label={`Keep ${wanted.source.path} as ${kind}`}
          title={`Keep as ${kind}`}
          onClick={() => void save()}
        >
          {kind}
        </button>
      ))}
    </span>
  );
}
