# What the rules of the report share: which studies, designs and calibrations are in it, and where a page stands.
from filtercake.report.catalogue import PAGES

PAGE_TEMPLATE = str(ROOT / "workflow" / "report" / "page.html.j2")
CAPTION_TEMPLATES = str(ROOT / "workflow" / "report" / "captions")


def caption_templates():
    return sorted(str(path) for path in Path(CAPTION_TEMPLATES).glob("*.j2"))


def page_part(wildcards):
    return PAGES[wildcards.page].part


def page_labels(wildcards):
    return {"page": PAGES[wildcards.page].title}


def figure_labels(wildcards):
    return {"figure": catalogue.title_of(wildcards.figure)}


def calibration_title(wildcards):
    return f"Calibration {wildcards.calibration.removeprefix('calibration_')}"


def calibrations_reported():
    """Calibrations of the studies in the report."""
    return [
        name
        for name, calibration in CALIBRATED.items()
        if Path(calibration.model.study).stem in STUDIES
    ]


def report_pages(wildcards):
    calibrated = calibrations_reported()
    folders = [f"{RESULTS}/{name}" for name in [*STUDIES, *calibrated]]
    folders += [f"{RESULTS}/{name}/design" for name in DESIGNS]
    documents = ["method", *(["calibration"] if calibrated else [])]
    return [
        *(f"{folder}/report/pages" for folder in folders),
        *(f"{RESULTS}/pages/{name}.html" for name in documents),
    ]
