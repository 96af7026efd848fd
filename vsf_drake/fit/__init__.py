"""Fits contact, geometry and shared errors of motion to recorded trials, and says what the fit is
worth.

    fit = ContactFit(
        [load_trial("soft.yaml"), load_trial("stiff.yaml")], bench=load_bench_file("bench.yaml"))
    solution = solve(fit)
    judged = assess(solution, [load_trial("other.yaml")])
    save_contact(solution.contact(verdict(solution, judged)), "contact.yaml")

With `options=PaperOptions()` the fit is that of McGeehan et al. 2021, done as it is written. Each
name stands in its own module: `problem`, `solution`, `assessment`, `options`.
"""
