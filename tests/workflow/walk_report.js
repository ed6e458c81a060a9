// Opens everything in a report by the links that a reader clicks, and leaves what was seen in the page.
const watched = [];
window.addEventListener("error", (event) => watched.push(String(event.message || event.target.src || "load")), true);
window.addEventListener("unhandledrejection", (event) => watched.push(String(event.reason)));
console.error = (...words) => watched.push(words.map(String).join(" "));
// --- after the report
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function until(condition) {
    for (let k = 0; k < 200 && !condition(); k++) await pause(50);
    return Boolean(condition());
}

// waits for what `find` looks for: the page draws itself after it has loaded
async function press(find, what) {
    if (!(await until(find))) throw new Error(`nothing to press: ${what}`);
    find().click();
    await pause(200);
}

const link = (text) => [...document.querySelectorAll("nav li a")].find((a) => a.innerText.trim() === text);
const home = () => press(() => document.querySelector("nav ol a"), "home");

async function openRow(number) {
    const row = () => document.querySelectorAll("nav tbody tr")[number];
    await press(() => row()?.querySelectorAll("td:last-child a")[0], `row ${number}`);
    const image = document.querySelector("nav + div img"), frame = document.querySelector("nav + div iframe");
    const shown = image ? await until(() => image.naturalWidth > 0 && image.clientWidth > 100) : Boolean(frame && frame.clientWidth > 100);
    return { kind: image ? "img" : "html", shown };
}

async function caption(number) {
    await press(() => document.querySelectorAll("nav tbody tr")[number]?.querySelectorAll("td:last-child a")[1], `caption ${number}`);
    const found = document.querySelector("nav .prose");
    return found ? found.innerText : "";
}

const pictures = () => [...document.querySelectorAll("nav + div .answers img")];

// what stands on the screen before anything is pressed
async function front() {
    await until(() => pictures().length && pictures().every((image) => image.naturalWidth > 0));
    const first = document.querySelector("nav + div .answers + p");
    return {
        pictures: pictures().map((image) => ({ title: image.alt, width: image.clientWidth })),
        above: pictures().every((image) => image.getBoundingClientRect().bottom <= first.getBoundingClientRect().top),
        seen: pictures().length > 0 && pictures()[0].getBoundingClientRect().top >= 0 && pictures()[0].getBoundingClientRect().bottom <= innerHeight,
        graph: Boolean(document.querySelector("div#rulegraph")),
    };
}

async function toPart(category, part) {
    await home();
    await press(() => link(category), category);
    if (Object.keys(categories[category]).length > 1) await press(() => link(part), part);
}

async function walk() {
    const seen = { front: await front(), categories: {}, drawn: {} };
    for (const name of ["Statistics", "Workflow"]) {
        await press(() => link(name), name);
        seen.drawn[name] = await until(() => document.querySelector("nav + div canvas, nav + div svg"));
        seen.drawn[`${name}, alone`] = !pictures().some((image) => image.clientWidth > 0);
    }
    await home();
    seen.again = await front();
    for (const [category, parts] of Object.entries(categories)) {
        seen.categories[category] = {};
        for (const part of Object.keys(parts)) {
            await toPart(category, part);
            const rows = [];
            for (let k = 0; k < document.querySelectorAll("nav tbody tr").length; k++) {
                const row = await openRow(k);
                row.caption = await caption(k);
                rows.push(row);
                await toPart(category, part);
            }
            seen.categories[category][part] = rows;
        }
    }
    return seen;
}

walk().catch((error) => (watched.push(String(error)), { front: {}, again: {}, categories: {}, drawn: {} })).then((seen) => {
    const requests = performance.getEntriesByType("resource").map((entry) => entry.name).filter((name) => !name.startsWith("data:"));
    const note = document.createElement("script");
    note.type = "application/json";
    note.id = "walked";
    note.textContent = JSON.stringify({ ...seen, errors: watched, requests });
    document.body.append(note);
});
