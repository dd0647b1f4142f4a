"""The stages: what each reads from the config and from artifacts, and the artifact it makes."""
