"""The zoo: control laws that papers on gyroscopes publish, each with its facts, its runs and verdicts on its claims."""
