/** The element of the editor: in a notebook it may be in a shadow tree, where the document does not find it. */
let root: HTMLElement | null = null;

export function setRoot(element: HTMLElement | null): void {
  if (element) root = element;
}

/** A part of the editor. */
export const find = <T extends HTMLElement>(selector: string): T | null => root?.querySelector<T>(selector) ?? null;

/** What has the keyboard's focus. */
export function focused(): HTMLElement | null {
  const tree = (root?.getRootNode() ?? document) as Document | ShadowRoot;
  return tree.activeElement as HTMLElement | null;
}
