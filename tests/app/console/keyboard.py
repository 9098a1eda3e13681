"""Using a page by the keyboard alone."""


def focused(page) -> dict:
    """What has the focus, and whether that can be seen."""
    return page.evaluate(
        """() => { const e = document.activeElement; return {
            tag: e.tagName, type: e.type || "", name: e.name || "", value: e.value || "",
            text: e.innerText || "",
            seen: [e, e.closest("label") || e].some(x => getComputedStyle(x).outlineStyle === "solid"
                && parseFloat(getComputedStyle(x).outlineWidth) >= 2)}; }"""
    )


def tab_to(page, wanted) -> dict:
    """Press Tab until the focused element is wanted; every one on the way shows its focus."""
    for _ in range(80):
        page.keyboard.press("Tab")
        found = focused(page)
        if found["tag"] != "BODY":
            assert found["seen"], f"the focus on {found} cannot be seen"
        if wanted(found):
            return found
    raise AssertionError("the keyboard does not reach it")


def press(page, text: str) -> None:
    """Tab to the button or link that says ``text``, and press it."""
    tab_to(page, lambda one: one["text"].strip() == text)
    page.keyboard.press("Enter")


def fill(page) -> None:
    """Answer whatever the focus comes by, and press the button that goes on."""
    path = page.url
    while True:
        at = tab_to(page, lambda one: one["name"].startswith("item.") or one["name"] == "go")
        if at["name"] == "go":
            break
        if at["type"] == "radio":
            page.keyboard.press("Space")
            page.keyboard.press("ArrowRight")
        elif at["name"] == "item.age":
            page.keyboard.type("34")
        else:
            page.keyboard.type("By keyboard")
    page.keyboard.press("Enter")
    page.wait_for_url(lambda url: url != path)
