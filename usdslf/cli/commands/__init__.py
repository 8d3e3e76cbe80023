"""The sub-commands: each module holds one, named like it, a few lines on Session."""
