# The report: `snakemake report` makes its captions and pages, `snakemake report --report FILE.html` puts them together, and
# opens on the front page with the stylesheet and the metadata that `make report` gives it.


report: "../report/front.rst"


ruleorder: calibration_pages > study_pages
ruleorder: design_pages > study_pages


DOCUMENTATION = {"method": "Method and assumptions", "calibration": "Calibration"}


wildcard_constraints:
    document="|".join(DOCUMENTATION),


rule report:
    input:
        report_pages,
    localrule: True


rule study_pages:
    input:
        lambda wildcards: f"{RESULTS}/{wildcards.study}/tables/table1.csv",
        filter_tables,
        points="{results}/{study}/points.csv",
        summary="{results}/{study}/summary.csv",
        replicates="{results}/{study}/replicates.csv",
        provenance="{results}/{study}/provenance.json",
        csds=csd_tables,
        crystallizer=crystallizer_tables,
        figures=lambda wildcards: expand(
            "{results}/{study}/figures/{figure}.png",
            results=RESULTS,
            study=wildcards.study,
            figure=figures_of(wildcards.study),
        ),
        page=PAGE_TEMPLATE,
        front=f"{CAPTION_TEMPLATES}/front_study.html.j2",
        templates=caption_templates(),
    output:
        captions=directory("{results}/{study}/report/captions"),
        pages=report(
            directory("{results}/{study}/report/pages"),
            patterns=["{page}.html"],
            category="Study {study}",
            subcategory=page_part,
            labels=page_labels,
        ),
    log:
        "{results}/{study}/logs/report.log",
    benchmark:
        "{results}/{study}/benchmarks/report.tsv"
    wildcard_constraints:
        results=re.escape(RESULTS),  # or <study>/design would be a study of a results folder <study>
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("report.captions"),
        study=lambda wildcards: study_of(wildcards).model.model_dump(mode="json"),
    message:
        "report pages of {wildcards.study}"
    script:
        "../scripts/study_pages.py"


rule calibration_pages:
    input:
        lambda wildcards: outputs_of_calibration(wildcards.calibration),
        files=measurement_files,
        summary="{results}/{calibration}/calibration.json",
        tables=expand("{{results}}/{{calibration}}/tables/{table}.csv", table=TABLES),
        predictions=prediction_tables,
        figures=lambda wildcards: [
            file
            for file in outputs_of_calibration(wildcards.calibration)
            if file.endswith(".png")
        ],
        page=PAGE_TEMPLATE,
        front=f"{CAPTION_TEMPLATES}/front_calibration.html.j2",
        templates=caption_templates(),
    output:
        captions=directory("{results}/{calibration}/report/captions"),
        pages=report(
            directory("{results}/{calibration}/report/pages"),
            patterns=["{page}.html"],
            category=calibration_title,
            subcategory=page_part,
            labels=page_labels,
        ),
    log:
        "{results}/{calibration}/logs/report.log",
    benchmark:
        "{results}/{calibration}/benchmarks/report.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("report.captions"),
        title=lambda wildcards: calibration_of(wildcards).model.title,
        labels=lambda wildcards: {
            name: csd.label
            for name, csd in calibration_of(wildcards).study.csds.items()
        },
        study=lambda wildcards: calibration_of(wildcards).study.model.model_dump(
            mode="json"
        ),
    message:
        "report pages of {wildcards.calibration}"
    script:
        "../scripts/calibration_pages.py"


rule design_pages:
    input:
        lambda wildcards: outputs_of_design(wildcards.study),
        summary="{results}/{study}/design/design.json",
        tables=expand(
            "{{results}}/{{study}}/design/tables/{table}.csv", table=DESIGN_TABLES
        ),
        figures=lambda wildcards: [
            file
            for file in outputs_of_design(wildcards.study)
            if file.endswith(".png")
        ],
        page=PAGE_TEMPLATE,
        front=f"{CAPTION_TEMPLATES}/front_design.html.j2",
        templates=caption_templates(),
    output:
        captions=directory("{results}/{study}/design/report/captions"),
        pages=report(
            directory("{results}/{study}/design/report/pages"),
            patterns=["{page}.html"],
            category=design_title,
            subcategory=page_part,
            labels=page_labels,
        ),
    log:
        "{results}/{study}/logs/design/report.log",
    benchmark:
        "{results}/{study}/benchmarks/design/report.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("report.captions"),
        study=lambda wildcards: study_of(wildcards).model.model_dump(mode="json"),
    message:
        "report pages of the design of {wildcards.study}"
    script:
        "../scripts/design_pages.py"


rule documentation_page:
    input:
        text=lambda wildcards: str(ROOT / "docs" / f"{wildcards.document}.md"),
        page=PAGE_TEMPLATE,
    output:
        report(
            "{results}/pages/{document}.html",
            category="Method",
            labels=lambda wildcards: {"page": DOCUMENTATION[wildcards.document]},
        ),
    log:
        "{results}/logs/pages/{document}.log",
    benchmark:
        "{results}/benchmarks/pages/{document}.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("report.markdown") + library("report.pages"),
        title=lambda wildcards: DOCUMENTATION[wildcards.document],
    message:
        "page {wildcards.document}"
    script:
        "../scripts/documentation_page.py"
