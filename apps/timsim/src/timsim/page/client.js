// What viser's page lacks: names of inputs for screen readers, Escape for dialogs, and room for an overlay on the scene.
(() => {
  // viser's page is dark where its address says so; it reads the address after this script
  if (matchMedia("(prefers-color-scheme: dark)").matches && !new URLSearchParams(location.search).has("darkMode")) {
    history.replaceState(null, "", `${location.pathname}${location.search ? `${location.search}&` : "?"}darkMode`);
  }

  const nameInputs = () => {
    for (const label of document.querySelectorAll("label[for]")) {
      const row = label.closest(".mantine-Flex-root");
      const words = label.textContent.replace(/\s+/g, " ").trim();
      if (!row || !words) continue;
      for (const input of row.querySelectorAll("input, textarea, [role=slider], .multi-slider-thumb")) {
        if (input.tagName === "DIV") input.setAttribute("role", "slider");
        if (!input.getAttribute("aria-label")) input.setAttribute("aria-label", words);
      }
      const group = row.querySelectorAll("button");
      if (group.length > 1 && !row.getAttribute("role")) {
        row.setAttribute("role", "group");
        row.setAttribute("aria-label", words);
      }
    }
  };

  window.addEventListener("keydown", event => {
    if (event.key !== "Escape") return;
    const dialog = [...document.querySelectorAll(".mantine-Modal-content")].pop();
    const close = dialog && [...dialog.querySelectorAll("button")].find(each => each.textContent.trim() === "Close");
    if (close) close.click();
  });

  // the overlay's elements stand in the panel, which may be folded away; on the scene stands a copy of them
  const copy = document.createElement("div");
  copy.className = "motorgrad-overlay";
  let shown = null;
  const overlay = () => {
    const source = document.querySelector(".motorgrad-overlay-source");
    const canvas = document.querySelector("canvas");
    if (!source || !canvas) return;
    if (!copy.isConnected) document.body.append(copy);
    if (source.innerHTML !== shown) copy.innerHTML = shown = source.innerHTML;
    const box = canvas.getBoundingClientRect();
    Object.assign(copy.style, { left: `${box.left}px`, top: `${box.top}px`, width: `${box.width}px` });
    copy.style.height = `${box.height}px`;
    copy.classList.toggle("motorgrad-narrow", box.width < 560);
  };

  const show = title => {
    const named = each => each.textContent.trim().toLowerCase() === title.toLowerCase();
    const tab = [...document.querySelectorAll("[role=tab]")].find(named);
    if (!tab) return false;
    for (const kind of ["pointerdown", "mousedown", "pointerup", "mouseup", "click"]) {  // a click alone moves no tab
      const Kind = kind.startsWith("pointer") ? PointerEvent : MouseEvent;
      tab.dispatchEvent(new Kind(kind, { bubbles: true, button: 0, pointerId: 1, isPrimary: true }));
    }
    return true;
  };
  // who clicks a part or a muscle sees its tab
  let fronted = "0";
  const bringForward = () => {
    const wanted = document.querySelector(".motorgrad-front");
    if (wanted && wanted.dataset.count !== fronted && show(wanted.textContent)) fronted = wanted.dataset.count;
  };

  // what stands behind the # of the address: at first, and when the user changes it, the page goes there
  let gone = 0, wanted = window.motorgrad.fragment, wantedTab = null;
  const go = () => {
    const here = document.querySelector(".motorgrad-own");
    if (!here || !here.dataset.go) return false;
    if (wanted) {
      wantedTab = new URLSearchParams(wanted.slice(1)).get("tab");
      const value = `${++gone}:${wanted.slice(1)}`;
      window.motorgrad.send({ type: "GuiUpdateMessage", uuid: here.dataset.go, updates: { value } });
      wanted = "";
    }
    if (wantedTab && show(wantedTab)) wantedTab = null;
    return !wantedTab;
  };
  // the place as the address has it, a moment only of a run that is paused
  const place = () => {
    const moment = document.querySelector(".motorgrad-moment"), here = document.querySelector(".motorgrad-own");
    const tab = document.querySelector("[role=tab][aria-selected=true]");
    const parts = new URLSearchParams();
    if (moment && moment.dataset.decision) parts.set("decision", moment.dataset.decision);
    if (here && here.dataset.camera) parts.set("camera", here.dataset.camera);
    if (tab) parts.set("tab", tab.textContent.trim());
    return `#${parts}`;
  };
  setInterval(() => {
    if (!go()) return;
    const now = place();
    if (now !== location.hash) history.replaceState(history.state, "", location.pathname + location.search + now);
  }, 500);
  window.addEventListener("hashchange", () => { wanted = location.hash; go(); });
  document.addEventListener("click", event => {
    const button = event.target.closest(".motorgrad-copy");
    if (!button) return;
    const address = (button.dataset.address || location.origin + location.pathname) + place();
    const done = words => { button.nextElementSibling.textContent = words; };
    const byHand = () => {  // an address that is not this machine's has no clipboard
      const field = document.createElement("textarea");
      field.value = address;
      document.body.append(field);
      field.select();
      done(document.execCommand("copy") ? "copied" : address);
      field.remove();
    };
    if (navigator.clipboard) navigator.clipboard.writeText(address).then(() => done("copied"), byHand);
    else byHand();
  });

  // the server draws only the panels that some browser shows, and so is told which tab is in front
  const setValue = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  let field = null;
  const tellTab = () => {
    if (!field || !field.isConnected) field = document.querySelector('input[aria-label="Tab in front"]');
    const tab = document.querySelector("[role=tab][aria-selected=true]");
    if (!field || !tab) return;
    const row = field.closest(".mantine-Flex-root");
    if (row && row.style.display !== "none") row.style.display = "none";
    const words = tab.textContent.trim();
    if (field.value === words) return;
    setValue.call(field, words);
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };

  let due = false;
  const renew = () => {
    due = false;
    bringForward();
    nameInputs();
    overlay();
    tellTab();
  };
  const later = () => {
    if (!due) { due = true; setTimeout(renew, 30); }
  };
  new MutationObserver(changes => {
    if (changes.some(change => !copy.contains(change.target))) later();
  }).observe(document.body, {
    childList: true, subtree: true, characterData: true, attributes: true, attributeFilter: ["aria-selected"],
  });
  window.addEventListener("resize", later);
})();
