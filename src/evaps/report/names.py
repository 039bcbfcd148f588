"""What methods are called in tables and figures."""

NAMES = {
    "lgrl": "LGRL",
    "lgrl-rl": "LGRL, rewarded",
    "transformer": "Transformer",
    "inferred-trace": "Inferred Trace",
    "latent-execution": "Latent Execution",
    "sed": "SED",
    "naive": "Naive",
    "evaps-o": "EVAPS+O",
    "evaps-s": "EVAPS+S",
    "evaps": "EVAPS",
    "evaps-parallel": "EVAPS, edits at once",
    "evaps-substitution": "EVAPS, substitutions",
    "evaps-no-goal": "EVAPS, goals unseen",
    "verified": "verified synthesis",
    "verified-no-guide": "without the inverse model",
    "verified-no-sharing": "without sharing among scenes",
    "verified-no-beam": "without LGRL's beam",
    "verified-with-repairs": "with EVAPS's repairs of the beam",
    "sed-search": "SED, best-first",
    "enumeration": "enumeration of programs by cost",
    "blind": "blind: programs drawn from the prior until one passes",
    "prior": "draws from the prior",
}


def name_of(method: str) -> str:
    """What a method is called, ``synthesizer+repairer`` by both; one of somebody else's by its own name."""
    return " + ".join(NAMES.get(part, part) for part in method.split("+"))
