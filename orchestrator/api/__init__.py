"""The public workflows, one module each; ``import orchestrator as oc`` gives their functions and results."""
