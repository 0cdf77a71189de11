/** The colours of lines, one after the other: those of motorgrad's figures, and their like for dark pages. */
const LIGHT = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#5B5F66"];
const DARK = ["#4FB0E5", "#F2894A", "#3CC79B", "#E39BC4", "#E0B54A", "#8CCBF0", "#A9AFB8"];

export const lineColour = (place: number, dark: boolean): string => {
  const colours = dark ? DARK : LIGHT;
  return colours[place % colours.length]!;
};

/** A colour of the page, as it is now. */
export const pageColour = (element: Element, name: string): string =>
  getComputedStyle(element).getPropertyValue(name).trim() || "#888";
