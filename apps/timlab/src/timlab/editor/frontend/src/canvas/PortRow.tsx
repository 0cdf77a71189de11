import { Handle, Position } from "@xyflow/react";
import { memo } from "react";
import { describe, misfit, shapeLabel } from "../session/ports";
import type { Port } from "../session/types";
import { useConnecting } from "./connecting";
import { portHeight } from "./geometry";

interface Props {
  block: string;
  port: Port;
  row: number;
  side: "input" | "output";
  /** What stands beside it. */
  label: string;
  wired: boolean;
  wanting: boolean;
  problem: string | undefined;
}

/** One port: its handle, and its name beside it. While a wire is drawn it shows whether it would fit. */
export const PortRow = memo(function PortRow({ block, port, row, side, label, wired, wanting, problem }: Props) {
  const input = side === "input";
  const fit = useConnecting(({ from }) => {
    if (!from || (from.block === block && from.side === side && from.port.name === port.name)) return "";
    if (from.side === side) return "unfit";
    const [source, target] = input ? [from.port, port] : [port, from.port];
    return misfit("", source, "", target) === null ? "fit" : "unfit";
  });
  const top = portHeight(row);
  const unit = port.unit ? `, ${port.unit}` : "";
  const help = port.help ? ` — ${port.help}` : "";
  const status = problem ?? (wanting ? "not connected" : "");
  const title = `${port.name}: ${describe(port)}${unit}${help}${status ? `\n${status}` : ""}`;
  const state = wanting ? "wanting" : problem ? "wrong" : wired ? "wired" : "";
  return (
    <>
      <Handle
        type={input ? "target" : "source"}
        position={input ? Position.Left : Position.Right}
        id={port.name}
        style={{ top }}
        className={`port ${port.kind} ${state} ${fit}`}
        role="img"
        aria-label={`${side} ${port.name} of ${block}`}
        title={title}
      />
      {label && (
        <span
          className={`port-name of-${side} ${label === port.name ? "" : "sign"}`}
          style={{ top: top - 9 }}
          title={title}
        >
          {label}
          {port.shape.length > 0 && <small>{shapeLabel(port)}</small>}
        </span>
      )}
    </>
  );
});
