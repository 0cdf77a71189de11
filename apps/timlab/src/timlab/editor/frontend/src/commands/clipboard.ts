import { scopeNow } from "../session/useScope";
import type { Value } from "../session/types";
import { toast, useUi } from "../ui/ui";
import type { Context } from "./command";
import { select, selection } from "./selection";

const FORMAT = "motorgrad diagram";
interface Fragment {
  [part: string]: Value | undefined;
  layout?: { positions?: Record<string, [number, number]> };
}

let held: Value = null;
let times = 0;

/** What was never put anywhere is copied with the place where it is seen. */
function withPlaces(fragment: Fragment, { flow }: Context): Value {
  const names = new Set(Object.keys(fragment.blocks as object));
  const seen = flow.getNodes().filter((node) => names.has(node.id));
  const positions = Object.fromEntries(seen.map(({ id, position }) => [id, [position.x, position.y]]));
  return { ...fragment, layout: { ...fragment.layout, positions } } as Value;
}

let copying: Promise<boolean> = Promise.resolve(false);

/** Keep the selected blocks as a document, here and for other windows. */
export function copy(context: Context): Promise<boolean> {
  copying = keep(context);
  return copying;
}

async function keep(context: Context): Promise<boolean> {
  const { names } = selection(context);
  if (!names.length) return false;
  const answer = await context.ask({ op: "fragment", at: useUi.getState().at, names });
  if (!answer) return false;
  held = withPlaces(answer.fragment as Fragment, context);
  times = 0;
  try {
    await navigator.clipboard.writeText(JSON.stringify(held, null, 1));
  } catch {
    // Without leave for the clipboard it can be pasted in this window only.
  }
  toast(names.length === 1 ? "Copied one block" : `Copied ${names.length} blocks`);
  return true;
}

async function other(): Promise<Value> {
  try {
    const data = JSON.parse(await navigator.clipboard.readText()) as { format?: string };
    return data.format === FORMAT ? (data as Value) : null;
  } catch {
    return null;
  }
}

/** How much lower what is pasted stands than what was copied, at every time; the size of a block not shown here. */
const [STEP, MOST_STEPS, UNSEEN] = [40, 25, { width: 120, height: 70 }];

/** The first of the steps from `least` on at which no block would cover one that is there. */
function freeStep(places: Record<string, [number, number]>, least: number, { flow }: Context): number {
  const there = flow.getNodes().map(({ id, position, measured }) => ({ id, ...position, ...UNSEEN, ...measured }));
  const sizes = new Map(there.map((box) => [box.id, box]));
  const covers = (by: number) =>
    Object.entries(places).some(([name, [x, y]]) => {
      const { width, height } = sizes.get(name) ?? UNSEEN;
      return there.some(
        (box) =>
          Math.abs(x + by + width / 2 - box.x - box.width / 2) < (width + box.width) / 2 &&
          Math.abs(y + by + height / 2 - box.y - box.height / 2) < (height + box.height) / 2,
      );
    });
  for (let step = least; step < least + MOST_STEPS; step += 1) if (!covers(STEP * step)) return step;
  return least;
}

/** Put in what was copied, a little lower at every time. */
export async function paste(context: Context): Promise<void> {
  await copying;
  const fragment = (await other()) ?? held;
  if (!fragment) return toast("Nothing was copied", true);
  const positions = (fragment as Fragment).layout?.positions ?? {};
  times = freeStep(positions, times + 1, context);
  const places = Object.values(positions);
  const corner = (i: 0 | 1) => (places.length ? Math.min(...places.map((place) => place[i])) : 0);
  const position = [corner(0) + STEP * times, corner(1) + STEP * times];
  const before = new Set(Object.keys(scopeNow().nodes));
  if (!(await context.ask({ op: "paste", at: useUi.getState().at, fragment, position }))) return;
  select(Object.keys(scopeNow().nodes).filter((name) => !before.has(name)));
}
