// A strip of plots below the scene, which a button over the scene opens and closes.
(() => {
  const SHARE = 0.36, NARROW = 768;  // of the window's height; pixels
  const open = Object.assign(document.createElement("button"), { className: "motorgrad-plots-open", textContent: "Plots" });
  let strip = null;
  const scene = () => document.querySelector("canvas")?.getBoundingClientRect();
  const settle = () => {
    const box = scene();
    if (!box || document.getElementById("motorgrad-cover")) return;
    if (!strip && !open.isConnected) document.body.append(open);
    Object.assign(open.style, { left: `${box.right - 76}px`, top: `${box.bottom - 42}px` });
  };
  const close = () => {
    strip.remove();
    strip = null;
    document.body.classList.remove("motorgrad-with-strip");
    open.hidden = false;
  };
  open.onclick = () => {
    if (window.innerWidth < NARROW) { window.open("plots", "_blank"); return; }  // the panel is where the strip would be
    strip = Object.assign(document.createElement("section"), { className: "motorgrad-plots motorgrad-strip" });
    strip.setAttribute("aria-label", "Plots");
    strip.style.height = `${100 * SHARE}vh`;
    document.body.append(strip);
    document.body.classList.add("motorgrad-with-strip");
    open.hidden = true;
    settle();
    motorgradPlots(strip, { strip: true, closed: close });
  };
  setInterval(settle, 300);
  window.addEventListener("resize", settle);
})();
