"""How does skill depend on the conditions?"""
