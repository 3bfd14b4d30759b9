"""The field models that are kept side by side, so that operators can compare them."""

MODELS = ("recursive", "single")
MODEL_TITLES = {
    "recursive": "Recursive, by position uncertainty",
    "single": "Single, positions taken for exact",
}
