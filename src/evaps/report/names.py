"""What methods are called in tables and figures."""

NAMES = {
    "evaps": "EVAPS",
    "lgrl": "LGRL",
    "naive": "Naive",
    "sed": "SED",
    "inferred-trace": "Inferred Trace",
    "latent-execution": "Latent Execution",
    "transformer": "Transformer",
    "evaps-o": "EVAPS+O",
    "evaps-s": "EVAPS+S",
    "lgrl-rl": "LGRL, rewarded",
    "evaps-parallel": "EVAPS, edits at once",
    "verified": "verified synthesis",
    "prior": "draws from the prior",
    "blind": "blind: draws from the prior until one passes",
    "latent-execution-retrained": "Latent Execution, second round",
    "evaps-substitution": "EVAPS, substitutions",
    "evaps-no-goal": "EVAPS, goals unseen",
    "sed-search": "SED, best-first",
    "naive-alone": "Naive, without the LSTM",
    "evaps-o-alone": "EVAPS+O, without the LSTM",
    "evaps-s-alone": "EVAPS+S, without the LSTM",
    "evaps-alone": "EVAPS, without the LSTM",
    "enumeration": "enumeration of programs by cost",
    "verified-no-guide": "without the inverse model",
    "verified-no-sharing": "without sharing among scenes",
    "verified-no-beam": "without LGRL's beam",
    "verified-with-repairs": "with EVAPS's repairs of the beam",
}


PLACES = {name: place for place, name in enumerate(NAMES.values())}
"""Of each of these names, so that a method can have one colour in all figures."""


def name_of(method: str) -> str:
    """What a method is called, ``synthesizer+repairer`` by both; one of somebody else's by its own name."""
    return " + ".join(NAMES.get(part, part) for part in method.split("+"))
