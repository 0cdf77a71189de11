import {
  applyEdgeChanges,
  applyNodeChanges,
  Background,
  type Connection,
  ConnectionMode,
  type FinalConnectionState,
  type HandleType,
  MiniMap,
  ReactFlow,
  SelectionMode,
  useStore,
} from "@xyflow/react";
import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { LEAST_ZOOM } from "../commands/view";
import { useContextOfCommands } from "../commands/useKeys";
import { misfitAt, portOf } from "../session/ports";
import { useProblems } from "../session/store";
import { scopeNow, useScope } from "../session/useScope";
import { enter, toast, useUi } from "../ui/ui";
import { BlockNode } from "./BlockNode";
import { useConnecting } from "./connecting";
import { ConnectionTip } from "./ConnectionTip";
import { type AnyNode, nodesOf, REMARK, wiresOf } from "./flow";
import { RemarkNode } from "./RemarkNode";
import { useArrival } from "./useArrival";
import { useDropped } from "./useDropped";
import { Wire, type WireType } from "./Wire";

const nodeTypes = { block: BlockNode, remark: RemarkNode };
const edgeTypes = { wire: Wire };
const GRID: [number, number] = [10, 10];
const PAN = [1, 2];
/** Below this zoom nothing small can be read: it is not drawn, and hundreds of blocks move without stutter. */
const READABLE = 0.35;
/** Keys that add to what is selected. */
const ADDING = ["Shift", "Control", "Meta"];

const addresses = (wire: Connection | WireType): [string, string] => [
  `${wire.source}.${wire.sourceHandle}`,
  `${wire.target}.${wire.targetHandle}`,
];

/** The diagram that is open, to be looked at and changed. */
export function Canvas() {
  const context = useContextOfCommands();
  const { ask } = context;
  const scope = useScope();
  const at = useUi((ui) => ui.at);
  const problems = useProblems();
  const pictures = useUi((ui) => ui.pictures);
  const [nodes, setNodes] = useState<AnyNode[]>([]);
  const [wires, setWires] = useState<WireType[]>([]);
  const moving = useRef(false);
  const far = useStore((flow) => flow.transform[2] < READABLE);
  const kept = useRef<string[]>([]);
  const drop = useDropped(context);
  useArrival(context, nodes.length > 0);

  useEffect(() => {
    setNodes((before) => nodesOf(scope, at, problems, before, moving.current));
    setWires((before) => wiresOf(scope, at, problems, before));
  }, [scope, at, problems, pictures]);

  const choose = useUi((ui) => ui.choose);
  useEffect(() => {
    if (!choose?.every((name) => nodes.some((node) => node.id === name))) return;
    const chosen = new Set(choose);
    const mark = <T extends { id: string; selected?: boolean }>(one: T): T =>
      !!one.selected === chosen.has(one.id) ? one : { ...one, selected: chosen.has(one.id) };
    useUi.setState({ choose: null });
    setNodes((before) => before.map(mark));
    setWires((before) => before.map((wire) => (wire.selected ? { ...wire, selected: false } : wire)));
  }, [choose, nodes]);

  const valid = useCallback((wire: Connection | WireType) => misfitAt(scopeNow(), ...addresses(wire)) === null, []);
  const connect = useCallback(
    (wire: Connection) => {
      const [source, target] = addresses(wire);
      void ask({ op: "connect", at, source, target });
    },
    [ask, at],
  );
  const begin = useCallback(
    (
      _: unknown,
      {
        nodeId,
        handleId,
        handleType,
      }: { nodeId: string | null; handleId: string | null; handleType: HandleType | null },
    ) => {
      const block = scopeNow().nodes[nodeId ?? ""];
      const side = handleType === "target" ? "input" : "output";
      const port = block && portOf(side === "input" ? block.inputs : block.outputs, handleId ?? "");
      if (port && nodeId) useConnecting.setState({ from: { block: nodeId, port, side } });
    },
    [],
  );
  const end = useCallback((_: unknown, state: FinalConnectionState) => {
    useConnecting.setState({ from: null });
    const { fromHandle: from, toHandle: to } = state;
    if (!from || !to || state.isValid || from === to || from.nodeId + from.id! === to.nodeId + to.id!) return;
    const [source, target] = from.type === "source" ? [from, to] : [to, from];
    const why =
      from.type === to.type
        ? "A wire leads from an output to an input"
        : misfitAt(scopeNow(), `${source.nodeId}.${source.id}`, `${target.nodeId}.${target.id}`);
    if (why) toast(why, true);
  }, []);
  const moved = useCallback(
    (_: unknown, __: unknown, those: AnyNode[]) => {
      moving.current = false;
      const place = (node: AnyNode): [number, number] => [node.position.x, node.position.y];
      const blocks = those.filter((node) => node.type === "block");
      const remarks = those.filter((node) => node.type === "remark");
      const now = scopeNow();
      // Blocks that were never put anywhere stay where they are seen, once one is moved.
      const loose = nodes.filter((node) => node.type === "block" && !now.nodes[node.id]?.position);
      const positions = Object.fromEntries([...loose, ...blocks].map((node) => [node.id, place(node)]));
      const boxes = Object.fromEntries(
        remarks.map((node) => [node.id.slice(REMARK.length), [...place(node), node.width ?? 200, node.height ?? 60]]),
      );
      void ask({ op: "move", at, positions, boxes });
    },
    [ask, at, nodes],
  );
  const select = useCallback(({ nodes: chosen }: { nodes: AnyNode[] }) => {
    useUi.setState({ selected: chosen.map((node) => node.id).filter((id) => !id.startsWith(REMARK)) });
  }, []);
  const defaults = useMemo(() => ({ type: "wire", focusable: true }), []);

  return (
    <div
      className={`canvas ${far ? "far" : ""}`}
      role="region"
      aria-label="canvas"
      {...drop}
      // A frame that is drawn with Shift adds to what is selected; the library begins anew.
      onPointerDownCapture={(event) => {
        kept.current = event.shiftKey ? useUi.getState().selected : [];
      }}
    >
      <ReactFlow
        nodes={nodes}
        edges={wires}
        nodeTypes={nodeTypes}
        edgeTypes={edgeTypes}
        defaultEdgeOptions={defaults}
        onNodesChange={(changes) => setNodes((before) => applyNodeChanges(changes, before))}
        onEdgesChange={(changes) => setWires((before) => applyEdgeChanges(changes, before))}
        isValidConnection={valid}
        onConnect={connect}
        onConnectStart={begin}
        onConnectEnd={end}
        connectionLineComponent={ConnectionTip}
        connectionMode={ConnectionMode.Strict}
        connectionRadius={28}
        onNodeDragStart={() => (moving.current = true)}
        onNodeDragStop={moved}
        onSelectionDragStart={() => (moving.current = true)}
        onSelectionDragStop={(event, those) => moved(event, null, those)}
        onNodeDoubleClick={(_, node) =>
          node.type === "block" && node.data.view.type === "diagram" && enter([...at, node.id])
        }
        onSelectionChange={select}
        onlyRenderVisibleElements
        snapToGrid
        snapGrid={GRID}
        minZoom={LEAST_ZOOM}
        maxZoom={3}
        selectionOnDrag
        selectionKeyCode={null}
        multiSelectionKeyCode={ADDING}
        onSelectionStart={() => useUi.setState({ choose: null })}
        onSelectionEnd={() =>
          kept.current.length && useUi.setState((ui) => ({ choose: [...kept.current, ...ui.selected] }))
        }
        selectionMode={SelectionMode.Partial}
        panOnDrag={PAN}
        panOnScroll
        zoomOnDoubleClick={false}
        deleteKeyCode={null}
        disableKeyboardA11y
        elevateEdgesOnSelect={false}
        proOptions={{ hideAttribution: true }}
      >
        <Background gap={20} size={1} />
        <MiniMap pannable zoomable aria-label="map" position="bottom-right" />
      </ReactFlow>
    </div>
  );
}
